"""What laws of a user cost beside the same law of the program.

A row of masses with smooth friction on each, as pairs and as functions in C, Fortran and Python, at
the same instants.
"""

from __future__ import annotations

import shutil
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import fretwear as fw
from bench.common.layout import milliseconds, table
from bench.common.measure import ROOT

__all__ = ["UserLaw", "measure_user_laws", "write_user_laws"]

N_ELEMENTS, POINTS, RUNS, INSTANTS = 16, 21, 7, 1024
FORCE, SPEED = 0.24, 0.2
#: What a law may take, as a share of the time with the pairs of the program.
WANTED = {"C": 1.3, "Fortran": 1.3, "Python": 3.0}

C = """
#include <math.h>
#include "fretwear.h"
const int fw_law_interface = 1;
int friction(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const double limit = call->parameters[0], per_speed = 1.0 / call->parameters[1];
   for (int k = 0; k < call->n_time; k++) {
      const double t = tanh(call->v[k] * per_speed);
      force[k] = limit * t;
      if (call->wants_derivative) dv[k] = limit * (1.0 - t * t) * per_speed;
   }
   return 0;
}
"""
FORTRAN = """
module friction_law
   use, intrinsic :: iso_c_binding
   implicit none
   type, bind(c) :: call_type
      integer(c_size_t) :: size
      integer(c_int) :: n_time, n_in, n_state, n_parameters, wants_derivative
      real(c_double) :: omega
      type(c_ptr) :: tau, u, v, parameters
   end type call_type
   integer(c_int), bind(c, name='fw_law_interface') :: interface_number = 1
contains
   integer(c_int) function friction(user, call, force, du, dv) bind(c)
      type(c_ptr), value :: user, du, dv
      type(call_type), intent(in) :: call
      real(c_double), intent(inout) :: force(call%n_time)
      real(c_double), pointer :: v(:), p(:), by_v(:)
      call c_f_pointer(call%v, v, [call%n_time])
      call c_f_pointer(call%parameters, p, [call%n_parameters])
      force = tanh(v/p(2))
      if (call%wants_derivative == 1) then
         call c_f_pointer(dv, by_v, [call%n_time])
         by_v = p(1)*(1 - force**2)/p(2)
      end if
      force = p(1)*force
      friction = 0
   end function friction
end module friction_law
"""


def friction(u: np.ndarray, v: np.ndarray, t: np.ndarray, omega: float) -> np.ndarray:
    """Smooth friction."""
    return FORCE * np.tanh(v / SPEED)


def slopes(u: np.ndarray, v: np.ndarray, t: np.ndarray, omega: float) -> tuple[np.ndarray, ...]:
    """Of it, by displacements and by rates."""
    dv = FORCE / SPEED * (1.0 - np.tanh(v / SPEED) ** 2)[..., None]
    return np.zeros_like(dv), dv


@dataclass(frozen=True)
class UserLaw:
    """Processor time [s] and Newton steps of a sweep in a language, the largest difference of its
    amplitudes from those with pairs, over the largest, and the time over theirs."""

    language: str
    seconds: float
    steps: int
    difference: float
    ratio: float


def measure_user_laws(folder: Path, quick: bool) -> list[UserLaw]:
    """Pairs, then functions in each language, turn by turn: the least times."""
    sides = list(range(1, N_ELEMENTS + 1))
    keys = {"n_elements": N_ELEMENTS, "symbol": "friction", "side_1": sides, "n_parameters": 2,
            "parameters": [FORCE, SPEED] * N_ELEMENTS, "odd": True}
    pairs = fw.ContactPairs([[dof, 0, 0] for dof in sides], mu=0.4, normal_load=0.4 * 1.5,
                            law="regularised", slip_speed=SPEED)
    ways = {"pairs": case({"contact": pairs}, {}, quick)}
    for language, library in libraries(folder).items():
        ways[language] = case({}, {"user": keys | {"library": str(library)}}, quick)
    ways["Python"] = case(
        {"laws": [fw.Law(friction, dof, derivative=slopes, odd=True) for dof in sides]}, {}, quick)
    seconds = dict.fromkeys(ways, np.inf)
    found = {}
    for _ in range(1 if quick else RUNS):
        for name, one in ways.items():
            start = time.process_time()
            found[name] = fw.run(one)
            seconds[name] = min(seconds[name], time.process_time() - start)
    level = found["pairs"].amplitude
    return [UserLaw(name, seconds[name], int(found[name].iterations.sum()),
                    float(np.abs(found[name].amplitude - level).max() / level.max()),
                    seconds[name] / seconds["pairs"]) for name in ways]


def libraries(folder: Path) -> dict[str, Path]:
    """Built with the compilers that there are."""
    built = {}
    for language, (compiler, suffix, source) in {
            "C": ("cc", "c", C), "Fortran": ("gfortran", "f90", FORTRAN)}.items():
        found = shutil.which(compiler)
        if found is None:
            continue
        text, library = folder / f"friction.{suffix}", folder / f"friction_{suffix}.so"
        text.write_text(source)
        subprocess.run([found, "-O3", "-march=native", "-ffast-math", "-shared", "-fPIC", "-I",
                        str(ROOT / "include"), "-J" if suffix == "f90" else "-I", str(folder),
                        "-o", str(library), str(text), "-lm"], check=True)
        built[language] = library
    return built


def case(parts: dict[str, object], more: dict[str, object], quick: bool) -> fw.Case:
    """A sweep over the resonances of the row; each mass stands on the ground too."""
    random = np.random.default_rng(5)
    k = random.uniform(0.1, 0.2, N_ELEMENTS + 1)
    mass = np.diag(random.uniform(0.9, 1.1, N_ELEMENTS))
    stiffness = np.diag(1.0 + k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    model = fw.Model(mass, 0.03 * mass, stiffness, cosine=np.linspace(0.5, 1.0, N_ELEMENTS),
                     **parts)
    return fw.Case(model, case={"analysis": "frf", "threads": 1},
                   harmonics={"n_harmonics": 7, "n_time": INSTANTS, "parity": "odd"},
                   sweep={"start": 0.8, "end": 1.3, "n_points": 3 if quick else POINTS}, **more)


def write_user_laws(rows: list[UserLaw]) -> str:
    """The section of the document."""
    return "\n".join([
        "## Laws of a user", "",
        f"A row of {N_ELEMENTS} masses with smooth friction on each, {POINTS} frequencies, H = 7, "
        f"{INSTANTS} instants: as pairs of the law `regularised`, and as functions of a user. "
        f"Processor time of the whole run in one thread, the least of {RUNS}, Newton steps, and "
        "the largest difference of the amplitudes from those of the pairs. The ratio is that of "
        "the times.", "",
        *table(["law", "time [ms]", "steps", "difference", "ratio", "wanted"],
               [(r.language, milliseconds(r.seconds), str(r.steps), f"{r.difference:.0e}",
                 f"{r.ratio:.2f}", "" if r.language not in WANTED else
                 f"{WANTED[r.language]}: {'met' if r.ratio <= WANTED[r.language] else 'missed'}")
                for r in rows])])
