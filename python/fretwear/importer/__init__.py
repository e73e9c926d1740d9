"""Models of other programs: ``fretwear import`` reads matrices, pairs and loads, checks them,
reduces them if wanted, and writes a model file."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from .._progress import stages
from ..errors import InputError, OutputError
from ..factors import ENGINES, chosen_engine
from .accuracy import Accuracy
from .blade import BladeNodes, read_blade
from .build import (
    ROLES,
    FullModel,
    Source,
    drop,
    gather,
    model_datasets,
    read_rows,
    read_speeds,
    save,
)
from .checks import check_model
from .contact import add_contact_arguments, pairs_of_options
from .finding import Finding
from .labels import Dofs, read_label_table
from .matrices import FORMATS, read_matrices
from .matrix_file import MatrixFile
from .meshes import ImportedMesh, read_mesh_file
from .sectors import FRAMES, Interfaces, axis_of, in_sector_frames, read_interfaces
from .stress import StressRows, read_stress_points, read_stress_table, stress_of_rows
from .tables import Pairs, contact_rows, read_loads, read_pairs

__all__ = ["FORMATS", "Accuracy", "BladeNodes", "Dofs", "Finding", "FullModel", "ImportedMesh",
           "Interfaces", "MatrixFile", "Pairs", "Source", "StressRows", "add_arguments",
           "check_model", "contact_rows", "drop", "gather", "main", "model_datasets", "read_blade",
           "read_interfaces", "read_label_table", "read_loads", "read_matrices", "read_mesh_file",
           "read_pairs", "read_speeds", "read_stress_points", "read_stress_table", "save",
           "stress_of_rows"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE",
                        help="files searched for mass, stiffness and damping by the usual names")
    parser.add_argument("-o", "--output", type=Path, metavar="MODEL.h5", help="model file to write")
    parser.add_argument("--check", action="store_true",
                        help="read and check, say what is found, write nothing")
    for role in ROLES:
        parser.add_argument("--" + role.replace("_", "-"), metavar="FILE[#NAME]",
                            type=Source.of, help=f"{role.replace('_', ' ')} matrix")
    parser.add_argument("--format", choices=sorted(FORMATS), help="of all files; else found out")
    parser.add_argument("--mirror", action="store_true",
                        help="a matrix with one triangle only is symmetric")
    parser.add_argument("--mass-factor", type=float, default=1.0, metavar="X",
                        help="multiplies the mass, such as 1e-3 from kg to tonnes")
    parser.add_argument("--labels", type=Path, metavar="TABLE",
                        help="equation, node and component of every degree of freedom")
    parser.add_argument("--mesh", type=Path, metavar="FILE",
                        help="mesh with the node numbers of the matrices, for ParaView and "
                             "animations: Nastran .bdf, Abaqus .inp, ANSYS .cdb, or another "
                             "format of meshio")
    parser.add_argument("--drop-empty", action="store_true",
                        help="leave out degrees of freedom without mass and stiffness")
    parser.add_argument("--pairs", type=Path, metavar="TABLE", help="contact pairs")
    parser.add_argument("--contact-rows", metavar="FILE[#NAME]", type=Source.of,
                        help="relative displacements t1, t2, n of the pairs, one after the other, "
                             "such as averages over patches")
    add_contact_arguments(parser)
    parser.add_argument("--loads", type=Path, metavar="TABLE", help="loads by degree of freedom")
    parser.add_argument("--observe", action="append", default=[], metavar="NAME=DOF",
                        help="observed degree of freedom: number or node:component; repeatable")
    parser.add_argument("--reduce", type=int, metavar="N_MODES",
                        help="reduce to relative displacements and so many bonded modes")
    parser.add_argument("--accuracy", type=float, metavar="X",
                        help="in place of --reduce: as many modes as an estimated error X of the "
                             "stiffness of the joint takes; needs --up-to")
    parser.add_argument("--up-to", type=float, metavar="HZ",
                        help="frequency up to which --accuracy is to hold: the highest harmonic "
                             "times the highest frequency")
    parser.add_argument("--verify", action="store_true",
                        help="compare the stiffness of the joint at --up-to with the full "
                             "matrices, by one factorization more")
    parser.add_argument("--factor", choices=ENGINES, default="auto",
                        help="who factors the stiffness: the first of mumps, cholmod and superlu "
                             "that is installed, or one of them by name (default: auto)")
    parser.add_argument("--sectors", type=int, metavar="N",
                        help="the model is one of N equal sectors around an axis; needs --left "
                             "and --right")
    for side in ("left", "right"):
        parser.add_argument(f"--{side}", type=Path, metavar="TABLE",
                            help=f"nodes of the {side} interface: columns node, x, y, z; the left "
                                 "ones, turned by a sector, lie on the right ones")
    parser.add_argument("--axis", default="z", metavar="AXIS",
                        help="of the disk, by the right hand from left to right: x, y, z, or -x, "
                             "-y, -z; write --axis=-z (default: z)")
    parser.add_argument("--frames", choices=FRAMES, default=FRAMES[0],
                        help="of the components of interface nodes, and of all nodes of a mesh; "
                             "Cartesian ones of the right interface are turned (default: "
                             "cylindrical)")
    parser.add_argument("--by-diameter", action="store_true",
                        help="reduce the sector on its own in every nodal diameter, without its "
                             "interfaces")
    parser.add_argument("--blade", type=Path, metavar="TABLE",
                        help="nodes of the blade above the disk (column node): its modes go into "
                             "the file as rows, by which blades may differ (&mistuning)")
    parser.add_argument("--blade-modes", type=int, metavar="N",
                        help="how many modes of the blade (default: 5)")
    parser.add_argument("--stress-rows", type=Source.of, metavar="FILE[#NAME]",
                        help="six rows xx, yy, zz, xy, yz, zx of each point: its stress for each "
                             "degree of freedom")
    parser.add_argument("--stress-table", type=Path, metavar="TABLE",
                        help="in place of it: point, dof and the six stresses of a unit of it")
    parser.add_argument("--stress-points", type=Path, metavar="TABLE",
                        help="places and strengths of these points: point, x, y, z, endurance, "
                             "ultimate")
    parser.add_argument("--at-speed", action="append", default=[], metavar="SPEED=FILE[#NAME]",
                        help="stiffness at a rotation speed [rad/s], beside that at rest; one to "
                             "three times")
    parser.add_argument("--title", default="", help="title of the model")
    parser.add_argument("--unit-system", default="", metavar="TEXT",
                        help="such as mm-tonne-s-N or m-kg-s-N; with one of these two, sizes are "
                             "checked too")
    parser.add_argument("-q", "--quiet", action="store_true", help="errors and warnings only")


def main(options: argparse.Namespace) -> int:
    """Import a model as told by the command line; returns the exit status."""
    if not options.check:
        if options.output is None:
            raise InputError("nothing to write: give -o MODEL.h5, or --check")
        if not options.output.absolute().parent.is_dir():
            raise OutputError(f"no folder to write {options.output} into")
    chosen_engine(options.factor)   # refused before the work
    model = _read(options)
    found = [Finding("note", "files", note) for note in model.notes] + check_model(
        model, options.factor)
    wanted = _modes(options)
    wrong = [finding for finding in found if finding.kind == "error"]
    if not wrong and options.check and wanted is not None:
        # Says what a reduction would refuse.
        model_datasets(model, wanted, options.by_diameter, factor=options.factor)
    for finding in found:
        if finding.kind == "warning" or (finding.kind == "note" and not options.quiet):
            print(finding, file=sys.stdout if options.check else sys.stderr)
    if wrong:
        raise InputError("\n".join(f"{finding.where}: {finding.text}" for finding in wrong))
    if options.check:
        print(f"no errors in {model.dofs.n} degrees of freedom, "
              f"{0 if model.pairs is None else len(model.pairs)} pairs")
        return 0
    for finding in save(model, options.output, wanted, options.by_diameter,
                        stages(quiet=options.quiet), options.factor,
                        verify=options.up_to if options.verify else None):
        if finding.kind == "warning" or not options.quiet:
            print(finding, file=sys.stderr)
    return 0


def _modes(options: argparse.Namespace) -> int | Accuracy | None:
    """How far the model is to be reduced."""
    if options.verify and (options.up_to is None or options.by_diameter):
        raise InputError("--verify needs --up-to HZ, the frequency that it compares at, and does "
                         "not go with --by-diameter")
    if options.accuracy is None:
        if options.up_to is not None and not options.verify:
            raise InputError("--up-to goes with --accuracy X or --verify")
        if options.verify and options.reduce is None:
            raise InputError("--verify goes with --reduce N_MODES or --accuracy X")
        return options.reduce
    if options.reduce is not None:
        raise InputError("--accuracy does not go with --reduce: it takes as many modes as it needs")
    if options.up_to is None:
        raise InputError("--accuracy needs --up-to HZ: the highest harmonic times the highest "
                         "frequency")
    return Accuracy(options.accuracy, options.up_to)


def _read(options: argparse.Namespace) -> FullModel:
    sources = {role: getattr(options, role) for role in ROLES
               if getattr(options, role) is not None}
    rows = None
    if options.contact_rows is not None:
        if options.pairs is None:
            raise InputError("--contact-rows needs --pairs: a table with a line for each pair")
        rows = read_rows(options.contact_rows, options.format)
    labels = None if options.labels is None else read_label_table(options.labels)
    model = gather(sources, options.files, format=options.format, mirror=options.mirror,
                   mass_factor=options.mass_factor, labels=labels)
    model = replace(model, stress=_stress_of_rows(options, model),
                    speeds=read_speeds(options.at_speed, options.format, model, options.mirror))
    model = drop(model, empty=options.drop_empty)
    model = replace(model, stress=_stress(options, model))
    touching, said = pairs_of_options(options, model.dofs)
    observe = {}
    for text in options.observe:
        name, equals, dof = text.rpartition("=")
        if not equals or not name:
            raise InputError(f"--observe {text}: expected NAME=DOF")
        observe[name] = model.dofs.signed(dof, f"--observe {text}")
        if observe[name] == 0:
            raise InputError(f"--observe {text}: the ground does not move")
    model = replace(
        model, observe=observe, title=options.title, unit_system=options.unit_system,
        notes=[*model.notes, *said],
        pairs=touching if options.pairs is None else read_pairs(options.pairs, model.dofs, rows),
        loads={} if options.loads is None else read_loads(options.loads, model.dofs),
        mesh=None if options.mesh is None else read_mesh_file(options.mesh))
    if options.blade_modes is not None and options.blade is None:
        raise InputError("--blade-modes goes with --blade TABLE")
    if options.blade is not None:
        model = replace(model, blade=read_blade(options.blade, model.dofs,
                                                 5 if options.blade_modes is None
                                                 else options.blade_modes))
    return _sector(model, options)


def _stress_of_rows(options: argparse.Namespace, model: FullModel) -> StressRows | None:
    """Stress by rows, whose columns are those of the files."""
    if options.stress_rows is None:
        return None
    return stress_of_rows(read_rows(options.stress_rows, options.format, "stress_rows"),
                          model.dofs.n)


def _stress(options: argparse.Namespace, model: FullModel) -> StressRows | None:
    """Stress by rows or by a table, with places and strengths of the points."""
    if options.stress_rows is not None and options.stress_table is not None:
        raise InputError("--stress-rows and --stress-table: give one of both")
    found = model.stress
    if options.stress_table is not None:
        found = read_stress_table(options.stress_table, model.dofs)
    if options.stress_points is None:
        return found
    if found is None:
        raise InputError("--stress-points goes with --stress-rows or --stress-table")
    return read_stress_points(options.stress_points, found)


def _sector(model: FullModel, options: argparse.Namespace) -> FullModel:
    """The model with the interfaces of a sector, where it is one."""
    given = [name for name in ("sectors", "left", "right") if getattr(options, name) is not None]
    if model.blade is not None and len(given) < 3:
        raise InputError("--blade needs --sectors, --left and --right: blades differ on a disk")
    if not given:
        if model.pairs is not None and model.pairs.sector_2 is not None:
            raise InputError(f"{options.pairs}: column sector_2 needs --sectors")
        return model
    if len(given) < 3:
        raise InputError(f"--{given[0]} needs --sectors, --left and --right")
    interfaces = read_interfaces(options.sectors, options.left, options.right, model.dofs,
                                 options.axis)
    if options.frames == "cartesian":
        model = in_sector_frames(model, interfaces)
    return replace(model, interfaces=interfaces, in_cylinder=None if options.frames == "cartesian"
                   else axis_of(options.axis))
