"""Reads cases through the C interface, one after the other, as long as it is asked to.

    library_child.py LIBRARY MEGABYTES

Every line of the standard input names a folder with a namelist case.nml; the answer is a line of
JSON: status and message of fw_load_file or fw_check, the peak of the memory in kB, and the
processor time in s. The process that started it learns of a crash by the end of this one.
"""
import ctypes
import json
import resource
import signal
import sys
import time
from pathlib import Path

#: Processor time of one input.
SECONDS = 10.0


def message_of(library, handle):
    buffer = ctypes.create_string_buffer(1 << 16)
    library.fw_get_message(handle, buffer, ctypes.c_size_t(len(buffer)))
    return buffer.value.decode("utf-8", errors="replace")


def check(library, path):
    handle = ctypes.c_void_p()
    if library.fw_create(ctypes.byref(handle)) != 0:
        return 1, "fw_create failed"
    status = library.fw_load_file(handle, str(path).encode())
    if status == 0:
        status = library.fw_check(handle)
    message = message_of(library, handle) if status else ""
    library.fw_destroy(handle)
    return status, message


def main():
    library = ctypes.CDLL(sys.argv[1])
    library.fw_get_message.restype = ctypes.c_size_t
    limit = int(sys.argv[2]) << 20
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for line in sys.stdin:
        signal.setitimer(signal.ITIMER_PROF, SECONDS) # its signal ends this process
        start = time.process_time()
        status, message = check(library, Path(line.rstrip("\n")) / "case.nml")
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        print(json.dumps([status, message, peak, time.process_time() - start]), flush=True)


if __name__ == "__main__":
    main()
