"""Models of other programs: ``fretwear import`` reads matrices, pairs and loads, checks them,
reduces them if wanted, and writes a model file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

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
from .calculix import Job, deck_loads, find_job, supports_of
from .ccx import add_ccx_arguments, ccx_files
from .checks import check_model
from .contact import add_contact_arguments, pairs_of_options
from .deck import Deck, read_deck
from .finding import Finding
from .labels import Dofs, read_label_table
from .matrices import FORMATS, read_matrices
from .matrix_file import MatrixFile
from .meshes import ImportedMesh, mesh_of_deck, read_mesh_file
from .sectors import (
    FRAMES,
    Interfaces,
    axis_of,
    cut_faces,
    in_sector_frames,
    pair_faces,
    read_interfaces,
)
from .stress import StressRows, read_stress_points, read_stress_table, stress_of_rows
from .tables import Pairs, add_load, contact_rows, read_loads, read_pairs, rows_by_sector
from .wheel import PICTURES, draw_wheel, wheel_of

__all__ = ["FORMATS", "Accuracy", "BladeNodes", "Dofs", "Finding", "FullModel", "ImportedMesh",
           "Interfaces", "MatrixFile", "Pairs", "Source", "StressRows", "add_arguments",
           "check_model", "contact_rows", "drop", "gather", "main", "model_datasets", "read_blade",
           "read_interfaces", "read_label_table", "read_loads", "read_matrices", "read_mesh_file",
           "read_pairs", "read_speeds", "read_stress_points", "read_stress_table", "save",
           "stress_of_rows"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE",
                        help="files searched for mass, stiffness and damping by the usual names; "
                             "of CalculiX the deck or a stored matrix of the job")
    parser.add_argument("-o", "--output", type=Path, metavar="MODEL.h5", help="model file to write")
    parser.add_argument("--check", nargs="?", const="", metavar="PICTURE",
                        help="read and check, say what is found, write no model; of a sector with "
                             "a mesh the PICTURE (.png, .svg, .pdf; .gif and .html move) shows "
                             "which way the wave of --engine-order runs, and -o is written too")
    parser.add_argument("--engine-order", type=int, metavar="M",
                        help="of the picture of --check (default: 1)")
    add_ccx_arguments(parser)
    for role in ROLES:
        parser.add_argument("--" + role.replace("_", "-"), metavar="FILE[#NAME]",
                            type=Source.of, help=f"{role.replace('_', ' ')} matrix")
    parser.add_argument("--format", choices=sorted(FORMATS), help="of all files; else found out")
    parser.add_argument("--mirror", action="store_true",
                        help="a matrix with one triangle only is symmetric")
    parser.add_argument("--unsymmetric", action="store_true",
                        help="an unsymmetric stiffness is meant, as of friction that slides: its "
                             "skew part goes into /stiffness_unsymmetric")
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
    parser.add_argument("--fix", action="append", default=[], metavar="DOF",
                        help="hold a degree of freedom, or those of a set (FOOT:3, FOOT for all); "
                             "repeatable")
    parser.add_argument("--pairs", type=Path, metavar="TABLE", help="contact pairs")
    parser.add_argument("--contact-rows", metavar="FILE[#NAME]", type=Source.of,
                        help="relative displacements t1, t2, n of the pairs, one after the other, "
                             "such as averages over patches")
    add_contact_arguments(parser)
    parser.add_argument("--loads", type=Path, metavar="TABLE", help="loads by degree of freedom")
    parser.add_argument("--load", action="append", default=[], metavar="DOF=VALUE",
                        help="cosine load of a degree of freedom, of each node of a set; "
                             "repeatable")
    parser.add_argument("--observe", action="append", default=[], metavar="NAME=DOF",
                        help="observed degree of freedom: number, node:component, or the mean of "
                             "a set of nodes, SET:component; repeatable")
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
                        help="the model is one of N equal sectors around an axis; its cut faces "
                             "are found in the mesh, or named by --left and --right")
    for side in ("left", "right"):
        parser.add_argument(f"--{side}", metavar="SET|TABLE",
                            help=f"nodes of the {side} interface: a set of the mesh, or a table "
                                 "with columns node, x, y, z; the left ones, turned by a sector, "
                                 "lie on the right ones")
    parser.add_argument("--axis", default="z", metavar="AXIS",
                        help="of the disk, by the right hand from left to right: x, y, z, or -x, "
                             "-y, -z; write --axis=-z (default: z)")
    parser.add_argument("--frames", choices=FRAMES,
                        help="of the components of interface nodes, and of all nodes of a mesh; "
                             "Cartesian ones of the right interface are turned (default: "
                             "cylindrical; of CalculiX cartesian, as it stores them)")
    parser.add_argument("--by-diameter", action="store_true",
                        help="reduce the sector on its own in every nodal diameter, without its "
                             "interfaces")
    parser.add_argument("--blade", type=Path, metavar="SET|TABLE",
                        help="nodes of the blade above the disk, a set of the mesh or a table "
                             "(column node): its modes go into the file as rows, by which blades "
                             "may differ (&mistuning)")
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
    picture = _picture(options)
    if options.check is None and options.output is None:
        raise InputError("nothing to write: give -o MODEL.h5, or --check")
    if options.output is not None and not options.output.absolute().parent.is_dir():
        raise OutputError(f"no folder to write {options.output} into")
    chosen_engine(options.factor)   # refused before the work
    options.files = ccx_files(options)
    model = _read(options)
    found = [note if isinstance(note, Finding) else Finding("note", "files", note)
             for note in model.notes] + check_model(model, options.factor)
    wanted = _modes(options)
    whole = model
    if options.by_diameter:
        # The mesh has found surfaces and cut faces; nodal diameters have no common one to show.
        model = replace(model, mesh=None)
    wrong = [finding for finding in found if finding.kind == "error"]
    if not wrong and options.check is not None and wanted is not None:
        # Says what a reduction would refuse.
        model_datasets(model, wanted, options.by_diameter, factor=options.factor)
    for finding in found:
        if finding.kind == "warning" or (finding.kind == "note" and not options.quiet):
            print(finding, file=sys.stderr if options.check is None else sys.stdout)
    if wrong:
        raise InputError("\n".join(f"{finding.where}: {finding.text}" for finding in wrong))
    if options.check is not None:
        if picture is not None:
            order = 1 if options.engine_order is None else options.engine_order
            for finding in draw_wheel(wheel_of(whole, order), picture):
                print(finding)
        print(f"no errors in {model.dofs.n} degrees of freedom, "
              f"{0 if model.pairs is None else len(model.pairs)} pairs")
        if picture is None or options.output is None:
            if options.output is not None:
                print(f"{options.output} is not written beside --check without a PICTURE")
            return 0
    for finding in save(model, options.output, wanted, options.by_diameter,
                        stages(quiet=options.quiet), options.factor,
                        verify=options.up_to if options.verify else None):
        if finding.kind == "warning" or not options.quiet:
            print(finding, file=sys.stderr)
    return 0


def _picture(options: argparse.Namespace) -> Path | None:
    """The picture that --check is to draw; what follows it and is none is a file to read."""
    path = Path(options.check) if options.check else None
    if path is not None and path.suffix.lower() not in PICTURES:
        options.files.insert(0, path)
        path = None
    if path is None and options.engine_order is not None:
        raise InputError("--engine-order goes with --check PICTURE (" + ", ".join(PICTURES) + ")")
    return path


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
    job = _job(options.files)
    files = options.files if job is None else [
        job.dofs, *(path for path in options.files if find_job(path) is None)]
    model = gather(sources, files, format=options.format, mirror=options.mirror,
                   mass_factor=options.mass_factor, labels=labels,
                   unsymmetric=options.unsymmetric)
    model = replace(model, stress=_stress_of_rows(options, model),
                    speeds=read_speeds(options.at_speed, options.format, model, options.mirror))
    model, deck = _with_mesh(model, options, job)
    fixed = {abs(dof) for text in options.fix for dof in _fixed(model.dofs, text)} - {0}
    model = drop(model, empty=options.drop_empty, fixed=fixed)
    model = replace(model, stress=_stress(options, model))
    touching, said = pairs_of_options(options, model.dofs, None if job is None else job.deck)
    observe = {}
    for text in options.observe:
        name, equals, dof = text.rpartition("=")
        if not equals or not name:
            raise InputError(f"--observe {text}: expected NAME=DOF")
        observe[name] = model.dofs.several(dof, f"--observe {text}")
        if 0 in observe[name]:
            raise InputError(f"--observe {text}: the ground does not move")
    places = {} if model.mesh is None else dict(zip(model.mesh.all_nodes.tolist(),
                                                    model.mesh.all_points))
    model = replace(
        model, observe=observe, title=options.title, unit_system=options.unit_system,
        notes=[*model.notes, *said],
        pairs=touching if options.pairs is None else read_pairs(options.pairs, model.dofs,
                                                                rows, places))
    model = _loaded(model, options, deck)
    if options.blade_modes is not None and options.blade is None:
        raise InputError("--blade-modes goes with --blade TABLE")
    if options.blade is not None:
        model = replace(model, blade=read_blade(options.blade, model.dofs,
                                                 5 if options.blade_modes is None
                                                 else options.blade_modes))
    return _sector(model, options, from_calculix=job is not None)


def _job(files: Sequence[Path]) -> Job | None:
    """The job of CalculiX that files belong to."""
    jobs = {job.dofs: job for job in map(find_job, files) if job is not None}
    if len(jobs) > 1:
        raise InputError("several jobs: " + ", ".join(map(str, jobs)) + "; give the files of one")
    return next(iter(jobs.values()), None)


def _with_mesh(model: FullModel, options: argparse.Namespace,
               job: Job | None) -> tuple[FullModel, Deck | None]:
    """The model with its mesh, with the sets and supports of a deck."""
    deck, mesh = None, None
    if job is not None and job.deck is not None:
        deck = read_deck(job.deck)
    if options.mesh is not None:
        mesh = read_mesh_file(options.mesh)
    elif deck is not None and any(cells.shape[1] for _, cells in deck.blocks):
        mesh = mesh_of_deck(deck)
    sets = {**({} if deck is None else deck.node_sets), **({} if mesh is None else mesh.sets)}
    notes = list(model.notes) + ([] if deck is None else list(deck.notes))
    held: set[tuple[int, int]] = set()
    if job is not None and deck is not None:
        held, dependent = supports_of(deck, model.dofs)
        if dependent:
            notes.append(f"{deck.path}: {len(dependent)} displacements have no row and are not "
                         f"held, {dependent[0][0]}:{dependent[0][1]} for one: they follow others "
                         "(*EQUATION, *TIE, a support along turned axes) and are shown at rest")
    return replace(model, mesh=mesh, dofs=model.dofs.with_sets(sets, held), notes=notes), deck


def _fixed(dofs: Dofs, text: str) -> list[int]:
    """Degrees of freedom that --fix names, of a set or node without a component all."""
    if ":" in text:
        return dofs.several(text, f"--fix {text}")
    if text.isdigit():
        return [dofs.signed(text, f"--fix {text}")]
    nodes = set(dofs.nodes(text, f"--fix {text}"))
    return [k for k, (node, _) in enumerate(dofs.labels or (), 1) if node in nodes]


def _loaded(model: FullModel, options: argparse.Namespace, deck: Deck | None) -> FullModel:
    """The model with loads of a table, of the command line, or of the deck of its job."""
    loads = {} if options.loads is None else read_loads(options.loads, model.dofs)
    notes = list(model.notes)
    for text in options.load:
        dof, _, value = text.rpartition("=")
        try:
            number = float(value)
        except ValueError:
            dof = ""
        if not dof:
            raise InputError(f"--load {text}: expected DOF=VALUE, such as TIP:3=5")
        add_load(loads.setdefault("cosine", np.zeros(model.dofs.n)), model.dofs, dof, number,
                 f"--load {text}")
    if deck is not None and options.loads is None and not options.load:
        loads, said = deck_loads(deck, model.dofs)
        notes += said
    return replace(model, loads=loads, notes=notes)


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


def _sector(model: FullModel, options: argparse.Namespace, from_calculix: bool) -> FullModel:
    """The model with the interfaces of a sector, where it is one."""
    if options.sectors is None:
        for name in ("left", "right", "blade"):
            if getattr(options, name) is not None:
                raise InputError(f"--{name} needs --sectors"
                                 + (": blades differ on a disk" if name == "blade" else ""))
        if model.pairs is not None and model.pairs.sector_2 is not None:
            raise InputError(f"{options.pairs}: column sector_2 needs --sectors")
        return model
    if (options.left is None) != (options.right is None):
        raise InputError(f"--{'left' if options.right is None else 'right'} needs --"
                         f"{'right' if options.right is None else 'left'} beside it")
    if from_calculix and options.frames == "cylindrical":
        raise InputError("--frames cylindrical: CalculiX stores its matrices along the global "
                         "axes, also of nodes with *TRANSFORM; leave --frames out")
    frames = options.frames or ("cartesian" if from_calculix else "cylindrical")
    if frames == "cylindrical" and (options.contact or options.contact_neighbour
                                    or options.deck_contact):
        raise InputError("--contact and --contact-neighbour need components along the "
                         "global axes, which normals are told in: take matrices with these, and "
                         "--frames cartesian")
    left, right, said = cut_faces(options.sectors, options.left, options.right, options.axis,
                                  model.mesh, *_touching(model))
    interfaces = pair_faces(options.sectors, left, right, model.dofs, options.axis, model.mesh)
    model = replace(model, notes=[*model.notes, *said])
    if frames == "cartesian":
        model = in_sector_frames(model, interfaces)
        model = replace(model, notes=[*model.notes, *_turned(model, interfaces)])
    model = replace(model, notes=[*model.notes, *_twice(model, interfaces)])
    return replace(model, interfaces=interfaces, axis=options.axis,
                   in_cylinder=None if frames == "cartesian" else axis_of(options.axis))


def _turned(model: FullModel, interfaces: Interfaces) -> list[Finding]:
    """Observed quantities and pairs that name nodes of the right face, whose components are along
    the axes of the next sector."""
    labels, partner = model.dofs.labels or [], dict(zip(interfaces.right_nodes,
                                                        interfaces.left_nodes))
    named = [(f"observed {name}", np.atleast_1d(dofs)) for name, dofs in model.observe.items()]
    if model.pairs is not None and model.pairs.rows is None:
        named += [(where, np.concatenate((one, two))) for where, one, two in zip(
            model.pairs.where, model.pairs.side_1, model.pairs.side_2)]
    found = []
    for where, dofs in named:
        nodes = {labels[abs(int(dof)) - 1][0] for dof in dofs if dof} & set(partner)
        if nodes:
            node = min(nodes)
            found.append(Finding("warning", where, f"node {node} is on the right face, where "
                                 "components are along the axes of the next sector; node "
                                 f"{partner[node]} of the left face has those of this one"))
    return found


def _twice(model: FullModel, interfaces: Interfaces) -> list[Finding]:
    """Loads on both faces: a node of both has the sum of what two sectors put there."""
    place: dict[int, list[int]] = {}
    for k, (node, _) in enumerate(model.dofs.labels or ()):
        place.setdefault(node, []).append(k)
    found = []
    for name, load in model.loads.items():
        both = [one for one, other in zip(interfaces.left_nodes, interfaces.right_nodes)
                if load[place.get(one, [])].any() and load[place.get(other, [])].any()]
        if both:
            found.append(Finding("warning", f"load {name}", f"{len(both)} nodes of the left face "
                                 f"and their partners on the right one are loaded, node {both[0]} "
                                 "for one: at such a node the loads of two sectors add up"))
    return found


def _touching(model: FullModel) -> tuple[set[int], set[int]]:
    """Nodes of pairs between sectors, and nodes of surfaces that touch between sectors."""
    pairs, labels = model.pairs, model.dofs.labels
    if pairs is None or pairs.sector_2 is None or labels is None:
        return set(), set()
    if pairs.rows is not None:
        one, two, _, sector = rows_by_sector(pairs, model.dofs.n)
        columns = np.concatenate([rows[sector != 0].indices for rows in (one, two)])
        return set(), {labels[k][0] for k in np.unique(columns).tolist()}
    sides = np.concatenate((pairs.side_1, pairs.side_2), axis=1)[pairs.sector_2 != 0]
    return {labels[abs(int(dof)) - 1][0] for dof in sides[sides != 0]}, set()
