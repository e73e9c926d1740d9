"""Commands whose process may take so much and no more.

The limits are set by a shell that becomes the command. A `preexec_fn` would fork this interpreter,
and OpenBLAS stops its threads before a fork: it waits for ever where another thread uses them.
"""
from __future__ import annotations

import os


def limited(command, seconds, grace, megabytes=None):
    """The command with limits of processor time [s] and, if given, of address space [MB].

    SIGXCPU comes after `seconds`, SIGKILL `grace` seconds later. Dumps no core.
    """
    limits = [f"-S -t {seconds}", f"-H -t {seconds + grace}", "-c 0"]
    if megabytes is not None:
        limits.append(f"-v {megabytes << 10}")
    script = "; ".join(f"ulimit {limit}" for limit in limits) + '; exec "$@"'
    return ["/bin/sh", "-c", script, "sh", *map(os.fspath, command)]
