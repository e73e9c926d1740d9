#!/usr/bin/env bash
# Install the package into a fresh environment and use it as the README says: run its ten lines,
# and compare the numbers with those of the fw_run that came along.
#
#     tools/check_install.sh WORK_DIRECTORY [CMAKE_BUILD]
#
# What CMAKE_BUILD, a build with CMake's own options, has compiled is not compiled again.
set -euo pipefail
root=$PWD
mkdir -p "$1"
work=$(cd "$1" && pwd)
started=$SECONDS
rm -rf "${work:?}"/*
[ $# -lt 2 ] || export SKBUILD_BUILD_DIR=$2
python3 -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check "$root"
echo "installed after $((SECONDS - started)) s"

# Isolated (-I): neither this source tree nor PYTHONPATH may serve what is not installed.
cd "$work"
ln -s "$root/example" example
sed -n '/^    import fretwear as fw$/,/savefig/s/^    //p' "$root/README.md" >ten_lines.py
MPLBACKEND=Agg venv/bin/python -I ten_lines.py
[ -s tip.png ]
echo "response and picture after $((SECONDS - started)) s"

venv/bin/fw_run -q -o program.h5 example/blade_sector/frf.nml
venv/bin/python -I - <<'END'
import fretwear as fw

here = fw.run("example/blade_sector/frf.nml", "package.h5")
for name in fw.Result("program.h5"):
    if name != "seconds":
        assert here[name].tobytes() == fw.Result("program.h5")[name].tobytes(), name
END
venv/bin/fretwear --version
venv/bin/fw_run --version
echo "the numbers of fw_run and of the package agree to the last bit"
