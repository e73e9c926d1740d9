#!/usr/bin/env python3
"""Self-test of the stand-in for pFUnit: every assertion marked `! must fail` has to fail, at its
own line and only there, and the program has to end with a non-zero status.

    check_must_fail.py PROGRAM FILE.pf
"""
import re
import subprocess
import sys
from pathlib import Path


def main(program, source):
    source = Path(source)
    lines = source.read_text(encoding="utf-8").splitlines()
    marked = {i for i, line in enumerate(lines, 1) if line.endswith("! must fail")}
    tests = sum(line.strip() == "@test" for line in lines)
    run = subprocess.run([program], capture_output=True, text=True, check=False)
    failed = [int(n) for n in re.findall(rf"^FAILED {re.escape(source.name)}:(\d+): ",
                                         run.stdout, re.MULTILINE)]
    problems = [f"line {n}: the assertion did not fail" for n in sorted(marked - set(failed))]
    problems += [f"line {n}: failed, but is not marked" for n in failed if n not in marked]
    problems += [f"line {n}: failed twice" for n in set(failed) if failed.count(n) > 1]
    if run.returncode != 1:
        problems.append(f"exit status {run.returncode} instead of 1")
    closing = run.stdout.rstrip().rpartition("\n")[2]
    if closing != f"0 passed, {tests} failed" or tests != len(marked):
        problems.append(f"closing line '{closing}' for {tests} tests and {len(marked)} marks")
    print("\n".join(problems) or "every assertion that must fail does")
    print(f"{len(marked & set(failed))} passed, {len(problems)} failed")
    return 1 if problems or not marked else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
