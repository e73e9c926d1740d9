#!/usr/bin/env python3
"""Turn pFUnit's .pf files into Fortran for the stand-in of pFUnit beside this script.

    pf_translate.py translate IN.pf OUT.F90     one test file, with its suite
    pf_translate.py driver OUT.f90 IN.pf ...    the main program over all suites
    pf_translate.py join IN.pf OUT.pf           for the real pFUnit: see below

Known directives: @test, @before, @after, @disable and the assertions of the stand-in's module
funit. Anything else that begins with @ is an error: a directive that is passed over in silence
would be a test that never runs.

An assertion may go on over several lines with &, and may end in a comment. pFUnit's own
preprocessor takes neither, so `join` writes such an assertion on one line, followed by empty
lines that keep the line numbers; the rest of the file is left alone.
"""
import re
import sys
from pathlib import Path

ASSERTIONS = {name.lower() for name in (
    "assertFail assertTrue assertFalse assertEqual assertNotEqual assertLessThan "
    "assertLessThanOrEqual assertGreaterThan assertGreaterThanOrEqual assertRelativelyEqual "
    "assertIsNaN assertIsFinite").split()}
SUBROUTINE = re.compile(r"\s*(?:recursive\s+)?subroutine\s+(\w+)", re.IGNORECASE)


class TestFileError(Exception):
    """What is wrong with a test file, with its place."""


def without_comment(line):
    """The line up to its comment; an exclamation mark inside quotes begins none."""
    quote = ""
    for i, char in enumerate(line):
        if quote:
            quote = "" if char == quote else quote
        elif char in "'\"":
            quote = char
        elif char == "!":
            return line[:i].rstrip()
    return line.rstrip()


def statements(path):
    """Yield (line number, number of lines, text); only directives are joined over lines."""
    lines = path.read_text(encoding="utf-8").splitlines()
    i = 0
    while i < len(lines):
        start, text = i, lines[i]
        i += 1
        if text.lstrip().startswith("@"):
            text = without_comment(text)
            while text.endswith("&"):
                if i == len(lines):
                    raise TestFileError(f"{path}:{start + 1}: the directive has no end")
                more = without_comment(lines[i]).strip()
                i += 1
                if more:  # a comment or an empty line may stand between
                    text = text[:-1].rstrip() + " " + more.removeprefix("&").lstrip()
        yield start + 1, i - start, text


class TestFile:
    """One .pf file: its Fortran text, and what its suite calls."""

    def __init__(self, path):
        self.path, self.name = path, path.stem
        self.tests, self.fixture, self.text = [], {}, [f'#line 1 "{path}"']
        self.waiting, self.disabled, module = "", False, ""
        for number, length, line in statements(path):
            found = re.match(r"\s*module\s+(\w+)\s*(!.*)?$", line, re.IGNORECASE)
            if found and not module:
                module = found[1]
            if line.lstrip().startswith("@"):
                self.directive(number, length, line.strip())
                continue
            found = SUBROUTINE.match(line)
            if found and self.waiting:
                self.procedure(found[1])
            self.text.append(line)
        if module.lower() != self.name.lower():
            raise TestFileError(f"{path}: the module must be called {self.name}, not '{module}'")
        if self.waiting or not self.tests:
            raise TestFileError(f"{path}: no subroutine after the last directive, or no test")

    def directive(self, number, length, line):
        where = f"{self.path}:{number}"
        found = re.match(r"@(\w+)\s*(?:\((.*)\))?$", line)
        word = found[1].lower() if found else ""
        if word in ASSERTIONS:
            arguments = [found[2].strip()] if found[2] and found[2].strip() else []
            place = f"location=SourceLocation('{self.path.name}', {number})"
            self.text += [f'#line {number} "{self.path}"',
                          f"call {found[1]}({', '.join(arguments + ['&'])}" if arguments
                          else f"call {found[1]}( &", f"   & {place})",
                          "if (anyExceptions()) return", f'#line {number + length} "{self.path}"']
        elif word in ("test", "before", "after", "disable") and found[2] is None:
            if word == "disable":
                if self.waiting != "test":  # pFUnit forgets a @disable that comes before
                    raise TestFileError(f"{where}: @disable belongs behind @test")
                self.disabled = True
            else:
                self.waiting = word
            self.text.append("")
        else:
            raise TestFileError(f"{where}: the stand-in for pFUnit does not know '{line}'")

    def procedure(self, name):
        if self.waiting != "test":
            self.fixture[self.waiting] = name
        elif not self.disabled:
            self.tests.append(name)
        self.waiting, self.disabled = "", False

    def suite(self):
        """The subroutine that runs every test of the file between its @before and @after."""
        yield f"subroutine standin_suite_{self.name}()"
        yield "   use funit, only: anyExceptions, standin_begin, standin_end"
        for name in self.tests + list(self.fixture.values()):
            yield f"   use {self.name}, only: {name}"
        yield "   implicit none (type, external)"
        for name in self.tests:
            yield f"   call standin_begin('{self.name}.{name}')"
            if "before" in self.fixture:
                yield f"   call {self.fixture['before']}()"
            yield f"   if (.not. anyExceptions()) call {name}()"
            if "after" in self.fixture:
                yield f"   call {self.fixture['after']}()"
            yield "   call standin_end()"
        yield f"end subroutine standin_suite_{self.name}"


def driver(names):
    """The main program; arguments name the test files to be run (default: all)."""
    yield "program standin_main"
    yield "   use funit, only: standin_finish"
    yield "   implicit none (type, external)"
    for name in names:
        yield f"   external :: standin_suite_{name}"
    yield "   character(200) :: name"
    yield "   integer :: i"
    yield "   if (command_argument_count() == 0) then"
    for name in names:
        yield f"      call standin_suite_{name}()"
    yield "   end if"
    yield "   do i = 1, command_argument_count()"
    yield "      call get_command_argument(i, name)"
    yield "      select case (name)"
    for name in names:
        yield f"      case ('{name}')"
        yield f"         call standin_suite_{name}()"
    yield "      case default"
    yield "         error stop 'no such test file'"
    yield "      end select"
    yield "   end do"
    yield "   call standin_finish()"
    yield "end program standin_main"


def main(arguments):
    if len(arguments) < 3 or arguments[0] not in ("translate", "driver", "join"):
        sys.exit(__doc__)
    mode, first, *rest = arguments
    if mode == "translate":
        test_file, output = TestFile(Path(first)), rest[0]
        lines = [*test_file.text, *test_file.suite()]
    elif mode == "driver":
        output, lines = first, driver([Path(path).stem for path in rest])
    else:
        output = rest[0]
        lines = [line for _, length, text in statements(Path(first))
                 for line in [text] + [""] * (length - 1)]
    Path(output).parent.mkdir(parents=True, exist_ok=True)
    Path(output).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except TestFileError as problem:
        sys.exit(str(problem))
