#!/usr/bin/env bash
# Install what the build needs: compilers and libraries through the system's package manager where
# that is allowed, Python packages into a virtual environment. Otherwise say what is missing.
#
#     tools/deps.sh VENV_DIRECTORY [run]
#
# `run`: of the Python packages only what building, running and drawing take.
#
# With BLAS=scipy, or BLAS=auto where the system's OpenBLAS does not know this processor, the newer
# one of the Python package scipy-openblas32 goes into the environment too.
set -euo pipefail
venv=$1
for_what=${2:-all}
run_packages=(numpy h5py matplotlib)
python_modules=(numpy scipy h5py skfem matplotlib xarray pyyeti meshio pymetis pyarrow distributed bokeh
                tqdm pint selenium pytest xdist gcovr nbclient ipykernel threadpoolctl mypy ruff
                fortitude ford sphinx numpydoc myst_parser yaml fpm)
python_packages=(numpy scipy h5py scikit-fem matplotlib xarray pyyeti meshio pymetis pyarrow distributed
                 bokeh tqdm pint selenium pytest pytest-xdist gcovr nbclient ipykernel
                 threadpoolctl mypy ruff fortitude-lint ford sphinx numpydoc myst-parser pyyaml fpm)
if [ "$for_what" = run ]; then
   python_modules=("${run_packages[@]}")
   python_packages=("${run_packages[@]}")
fi

has_command() { command -v "$1" >/dev/null 2>&1; }

# Can a Fortran program be linked with these libraries? Names differ between systems, so any of
# the alternatives will do.
links() {
   local directory name
   has_command gfortran || return 1
   directory=$(mktemp -d)
   echo 'end' >"$directory/probe.f90"
   for name; do
      if gfortran "$directory/probe.f90" -o "$directory/probe" "-l$name" 2>/dev/null; then
         rm -r "$directory"
         return 0
      fi
   done
   rm -r "$directory"
   return 1
}

has_venv() { python3 -c 'import venv, ensurepip' 2>/dev/null; }

# Every probe with the Debian package that makes it succeed.
missing_packages() {
   has_command gfortran || echo gfortran
   has_command gcc || echo gcc
   has_command g++ || echo g++
   links m || echo libc6-dev
   has_command cmake || echo cmake
   has_command ninja || echo ninja-build
   has_command pkg-config || echo pkg-config
   links openblas || echo libopenblas-dev
   links minpack || echo minpack-dev
   links fftw3 || echo libfftw3-dev
   links hdf5_serial_fortran hdf5_fortran || echo libhdf5-dev
   links sundials_cvode || echo libsundials-dev
   links sundials_fcvode_mod || echo libsundials-fortran-dev
   has_venv || echo python3-venv
}

install_packages() {
   local as_root=()
   has_command apt-get || return 1
   if [ "$(id -u)" -ne 0 ]; then
      has_command sudo && sudo -n true 2>/dev/null || return 1
      as_root=(sudo -n)
   fi
   echo "deps: installing $*" >&2
   # An index that is only partly reachable may still hold every package.
   "${as_root[@]}" apt-get update -qq || true
   "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
      apt-get install -y -qq --no-install-recommends "$@" >&2
}

if ! has_command python3; then
   echo "deps: python3 (3.9 or later) is needed" >&2
   exit 1
fi

mapfile -t missing < <(missing_packages)
if [ "${#missing[@]}" -gt 0 ]; then
   install_packages "${missing[@]}" || true
   mapfile -t missing < <(missing_packages)
fi
if [ "${#missing[@]}" -gt 0 ]; then
   {
      echo "deps: these packages (names of Debian and Ubuntu) are missing and could not be"
      echo "installed from here. Please install them and try again:"
      printf '   %s\n' "${missing[@]}"
   } >&2
   exit 1
fi

has_modules() {
   "$1" -c 'import sys; from importlib.util import find_spec
sys.exit(any(find_spec(name) is None for name in sys.argv[1:]))' "${python_modules[@]}"
}

# An environment of its own, which takes further packages.
stands_alone() {
   grep -qs 'include-system-site-packages = false' "$1/pyvenv.cfg" &&
      "$1/bin/python" -m pip --version >/dev/null 2>&1
}

# An environment that is active lends its packages to no other one.
is_system() { python3 -c 'import sys; sys.exit(sys.prefix != sys.base_prefix)'; }

# Where the interpreter has every module already nothing is downloaded; otherwise the environment
# stands alone, because packages of two origins need not fit each other.
if ! { [ -x "$venv/bin/python" ] && has_modules "$venv/bin/python"; }; then
   if ! stands_alone "$venv"; then rm -rf "$venv"; fi
   if [ ! -d "$venv" ] && is_system && has_modules python3; then
      python3 -m venv --system-site-packages --without-pip "$venv"
   else
      if [ "$for_what" = run ]; then
         echo "deps: Python packages into $venv, for pictures" >&2
      else
         echo "deps: Python packages into $venv, for pictures and tests (some minutes)" >&2
      fi
      [ -d "$venv" ] || python3 -m venv "$venv"
      # Byte code comes with the first use of a module: of most there is none.
      if ! "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile \
         "${python_packages[@]}"; then
         echo "deps: pip could not install ${python_packages[*]} into $venv" >&2
         exit 1
      fi
   fi
fi

# Does OpenBLAS run a kernel below what the processor can do?
has_slow_blas() {
   local directory here
   here=$PWD
   directory=$(mktemp -d)
   (cd "$directory" && gcc -c "$here/src/base/blas_kernel.c" &&
      gfortran "$here/src/base/blas.f90" "$here/cmake/blas_probe.f90" blas_kernel.o -lopenblas \
         -o probe) 2>/dev/null || { rm -r "$directory"; return 1; }
   "$directory/probe" | grep -q '^slow'
   local slow=$?
   rm -r "$directory"
   return $slow
}

# An environment without pip takes the package through that of the system.
install_blas() {
   local place
   "$venv/bin/python" -m pip install --quiet --disable-pip-version-check scipy-openblas32 \
      2>/dev/null && return
   place=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
   python3 -m pip install --quiet --disable-pip-version-check --no-deps --target "$place" \
      scipy-openblas32
}

blas=${BLAS:-system}
if [ "$blas" = scipy ] || { [ "$blas" = auto ] && has_slow_blas; }; then
   if ! "$venv/bin/python" -c 'import scipy_openblas32' 2>/dev/null; then
      echo "deps: scipy-openblas32 into $venv" >&2
      install_blas || echo "deps: scipy-openblas32 could not be installed" >&2
   fi
fi
