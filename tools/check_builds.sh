#!/usr/bin/env bash
# The ways to build that README.md names beside `make`, each with an example whose number is known:
# CMake alone and fpm, from nothing; pip on what the first has compiled. The tests are compiled and
# run by `make test`. Nothing is optimised here, which takes a third of the time: what is asked is
# whether each way finds its sources, its order and its libraries.
#
#     tools/check_builds.sh WORK_DIRECTORY PYTHON
set -euo pipefail
mkdir -p "$1"
work=$(cd "$1" && pwd)
python=$2
example=example/jenkins/jenkins.nml
expected='peak u1 *9.79602'

# The program that follows has to find the peak of the example.
finds_the_peak() {
   "$@" -o "$work/result.h5" "$example" >"$work/said" 2>"$work/progress"
   grep -q "$expected" "$work/said" || {
      echo "$1: no line '$expected' in:" >&2
      cat "$work/said" >&2
      return 1
   }
}

started=$SECONDS
rm -rf "${work:?}/cmake"
cmake -S . -B "$work/cmake" -G Ninja -DFRETWEAR_TESTS=OFF -DCMAKE_BUILD_TYPE=None >"$work/log"
cmake --build "$work/cmake" >>"$work/log" || { tail -n 30 "$work/log"; exit 1; }
finds_the_peak "$work/cmake/fw_run"
echo "CMake: $((SECONDS - started)) s"

started=$SECONDS
SKBUILD_CMAKE_BUILD_TYPE=None tools/check_install.sh "$work/wheel" "$work/cmake"
echo "pip: $((SECONDS - started)) s"

started=$SECONDS
# fpm adds to the library of an earlier build, and leaves in it what has moved.
rm -f build/gfortran_*/fretwear/libfretwear.a
"$python" -m fpm build --flag -O0 >"$work/log" 2>&1 || { tail -n 30 "$work/log"; exit 1; }
finds_the_peak "$python" -m fpm run --flag -O0 fw_run --
echo "fpm: $((SECONDS - started)) s"
