#!/usr/bin/env bash
# Build the conda package: SUNDIALS with its Fortran modules and MINPACK into a folder of the
# package, because conda-forge has neither (its SUNDIALS comes without them), then the package.
# rattler-build sets SRC_DIR, PREFIX and PYTHON. ONLY_LIBRARIES=1 ends before the package.
set -euo pipefail
# Beside a SUNDIALS of conda-forge, which may be in the same environment under the same names.
libraries=$PREFIX/lib/fretwear
jobs=${CPU_COUNT:-2}

cmake -S "$SRC_DIR/sundials" -B "$SRC_DIR/build_sundials" -G Ninja -DCMAKE_BUILD_TYPE=Release \
   -DCMAKE_INSTALL_PREFIX="$libraries" -DCMAKE_INSTALL_LIBDIR=lib "-DCMAKE_INSTALL_RPATH=\$ORIGIN" \
   -DFortran_INSTALL_MODDIR=fortran -DBUILD_FORTRAN_MODULE_INTERFACE=ON \
   -DBUILD_SHARED_LIBS=ON -DBUILD_STATIC_LIBS=OFF -DBUILD_CVODES=OFF -DBUILD_IDAS=OFF \
   -DEXAMPLES_ENABLE_C=OFF -DEXAMPLES_ENABLE_F2003=OFF -DEXAMPLES_INSTALL=OFF
cmake --build "$SRC_DIR/build_sundials" -j "$jobs"
cmake --install "$SRC_DIR/build_sundials"

# The routines of netlib alone: no configure of 1996. Static, so that nothing of it is installed twice.
mkdir -p "$SRC_DIR/build_minpack" "$libraries/lib"
(cd "$SRC_DIR/build_minpack" && for file in "$SRC_DIR"/minpack/*.f; do
   "${FC:-gfortran}" -O2 -fPIC -std=legacy -w -c "$file"
done)
"${AR:-ar}" rcs "$libraries/lib/libminpack.a" "$SRC_DIR"/build_minpack/*.o
if [ -n "${ONLY_LIBRARIES:-}" ]; then exit 0; fi

# Without FFTW, as the wheels: the package may be given away under the BSD licence.
CMAKE_PREFIX_PATH="$libraries:$PREFIX" "$PYTHON" -m pip install "$SRC_DIR/fretwear" -vv --no-deps \
   --no-build-isolation --config-settings=cmake.define.FRETWEAR_FFT=none \
   "--config-settings=cmake.define.CMAKE_INSTALL_RPATH=$libraries/lib"
# What only a compiler reads stays out of the package.
rm -rf "$libraries"/{include,fortran,lib/cmake,lib/libminpack.a}
