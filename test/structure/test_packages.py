"""What the packages say of themselves: one version, the same dependencies, a recipe."""
from __future__ import annotations

import re
import sys

import pytest
import yaml
from project import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

RECIPE = ROOT / "conda" / "recipe.yaml"
#: What conda calls a package that is called otherwise elsewhere.
CONDA_NAMES = {"matplotlib": "matplotlib-base"}
#: What the build looks for, and the package or the sources of the recipe that hold it.
HOLDERS = {"LAPACK": "liblapack", "HDF5": "hdf5", "MINPACK": "minpack",
           "SUNDIALSFortran": "sundials", "OpenMP": "compiler('fortran')"}


def toml(name):
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


def rendered():
    """The recipe with its context put in; what only the builder knows stays."""
    text = RECIPE.read_text(encoding="utf-8")
    context = yaml.safe_load(text)["context"]
    text = re.sub(r"\$\{\{ (\w+) \}\}", lambda found: str(context[found[1]]), text)
    return yaml.safe_load(text)


def requirement(text):
    """Name and bounds: numpy>=1.24 and numpy >=1.24 are one."""
    name, bounds = re.fullmatch(r"([\w.-]+)\s*(.*)", text).groups()
    return CONDA_NAMES.get(name, name), bounds.replace(" ", "")


def test_there_is_one_version():
    source = (ROOT / "src" / "base" / "version.f90").read_text(encoding="utf-8")
    version = re.search(r"version = '([0-9.]+)'", source)[1]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert toml("fpm.toml")["version"] == version
    assert cited["version"] == version and cited["cff-version"] == "1.2.0"
    assert rendered()["package"] == {"name": "fretwear", "version": version}
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## \[([0-9.]+)\]", changes, re.MULTILINE)[1] == version
    assert toml("pyproject.toml")["project"]["dynamic"] == ["version"]


def test_the_recipe_asks_for_what_the_package_asks_for():
    project = toml("pyproject.toml")
    needs = rendered()["requirements"]
    run = [requirement(text) for text in needs["run"]]
    wanted = [requirement(text) for text in project["project"]["dependencies"]]
    assert run == [("python", project["project"]["requires-python"]), *wanted]
    host = {requirement(text) for text in needs["host"]}
    assert {requirement(text) for text in project["build-system"]["requires"]} <= host
    cmake = project["tool"]["scikit-build"]["cmake"]["version"]
    assert ("cmake", cmake) in {requirement(text) for text in needs["build"] if "$" not in text}


def test_the_recipe_has_what_the_build_looks_for():
    dependencies = (ROOT / "cmake" / "FretwearDependencies.cmake").read_text(encoding="utf-8")
    found = set(re.findall(r"^ *find_dependency\((\w+)", dependencies, re.MULTILINE))
    assert found - {"FFTW3"} == set(HOLDERS), "a dependency without its place in the recipe"
    recipe = rendered()
    at_hand = " ".join([*recipe["requirements"]["build"], *recipe["requirements"]["host"],
                        *(source.get("target_directory", "") for source in recipe["source"])])
    assert [name for name, holder in HOLDERS.items() if holder not in at_hand] == []
    script = (ROOT / "conda" / "build.sh").read_text(encoding="utf-8")
    assert "FRETWEAR_FFT=none" in script, "FFTW is not there"
    assert "BUILD_FORTRAN_MODULE_INTERFACE=ON" in script
    assert all(re.fullmatch("[0-9a-f]{64}", source["sha256"]) for source in recipe["source"]
               if "url" in source)


def test_licence_and_names_agree():
    project = toml("pyproject.toml")["project"]
    recipe = rendered()
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert project["license"]["text"] == recipe["about"]["license"] == cited["license"]
    assert (ROOT / recipe["about"]["license_file"].removeprefix("fretwear/")).exists()
    assert recipe["about"]["summary"] == project["description"] == toml("fpm.toml")["description"]
    entry = recipe["build"]["python"]["entry_points"]
    assert entry == [f"{name} = {place}" for name, place in project["scripts"].items()]
    assert set(project["keywords"]) - {"contact"} <= set(cited["keywords"])


def test_the_builder_takes_the_recipe():
    """By the program that builds packages, where it is installed."""
    builder = pytest.importorskip("rattler_build")
    recipe = builder.Stage0Recipe.from_yaml(RECIPE.read_text(encoding="utf-8"))
    rendered_by_it = recipe.render(builder.VariantConfig(
        {"c_stdlib": ["sysroot"], "c_stdlib_version": ["2.17"], "python": ["3.11"]}))
    assert len(rendered_by_it) == 1
