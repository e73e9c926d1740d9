#!/usr/bin/env bash
# Install a wheel into a fresh environment, run the ten lines of the README and fw_run there, and
# look at every library that was loaded: each comes with the wheel, with its Python packages, or
# belongs to what every Linux has (the C library, and that of Python itself).
#
#     tools/check_wheel.sh WHEEL WORK_DIRECTORY PYTHON
set -euo pipefail
wheel=$(realpath "$1")
root=$PWD
rm -rf "$2"
"$3" -m venv "$2"
work=$(cd "$2" && pwd)
python=$(realpath -s "$3")
# The packages that it needs are fetched beforehand: how fast they come is not the wheel's doing.
mkdir "$work/packages"
"$work/bin/python" -m pip download --quiet --disable-pip-version-check -d "$work/packages" "$wheel"
cd "$work"
ln -s "$root/example" example
sed -n '/^    import fretwear as fw$/,/savefig/s/^    //p' "$root/README.md" >ten_lines.py
cat >>ten_lines.py <<'END'
import sys
print(*sorted({line.split()[-1] for line in open("/proc/self/maps") if ".so" in line}), sep="\n",
      file=open("loaded", "w"))
END

# Nothing but the environment on the path: no compiler, no build tree, no other Python.
started=$SECONDS
run() { /usr/bin/env -i HOME="$work" PATH="$work/bin" MPLBACKEND=Agg "$@"; }
# Byte code of all modules of NumPy, SciPy and Matplotlib, most of which nobody loads, takes pip three
# quarters of the time; Python makes that of those that are loaded.
run bin/python -m pip install --quiet --disable-pip-version-check --no-compile --no-index -f packages \
   "$wheel"
echo "installed after $((SECONDS - started)) s"
run bin/python -I ten_lines.py
[ -s tip.png ]
echo "response and picture after $((SECONDS - started)) s"
run fw_run -q -o program.h5 example/blade_sector/frf.nml
[ -s program.h5 ]

belongs="^($work|$(realpath "$work")|$(realpath "$("$python" -c 'import sys; print(sys.base_prefix)')")/lib/python)"
everywhere='/(ld-linux[^/]*|lib(c|m|dl|pthread|rt|util|mvec|gcc_s|stdc\+\+|z|uuid|expat|ffi|bz2|lzma|crypto|ssl|python3[^/]*))[-.]'
if grep -Ev "$belongs" loaded | grep -Ev "$everywhere"; then
   echo "wheel: the libraries above are of this system and not of the wheel" >&2
   exit 1
fi
for library in "$work"/lib/python*/site-packages/fretwear.libs/*; do
   case $(basename "$library") in
   *fftw* | *curl* | *crypto* | *gnutls*)
      echo "wheel: $library may not be given away with it" >&2
      exit 1 ;;
   esac
done
echo "nothing outside the wheel and its packages was loaded"
