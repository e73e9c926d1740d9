"""`fretwear explore`: a page with sliders whose curve, loops and flanks follow."""

from __future__ import annotations

import argparse
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .._native import namelist_values
from ..case import Case
from ..errors import InputError
from .sliders import Slider, read_slider, usual_sliders

__all__ = ["Slider", "add_arguments", "main", "serve"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear explore`."""
    parser.add_argument("case", help="namelist of a frequency sweep")
    parser.add_argument("--slider", metavar="KEY=LOW:HIGH", action="append", default=[],
                        help="a key and its range, such as contact%%mu=0.1:0.8 (repeat for more; "
                        "default: load, friction, rotation speed, harmonics)")
    parser.add_argument("--port", type=int, default=0, metavar="N",
                        help="port on this machine (default: any free one)")
    parser.add_argument("--max-seconds", type=float, default=20.0, metavar="S",
                        help="a sweep is stopped after this time (default: %(default)s)")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear explore` until it is interrupted."""
    case = Case.from_file(options.case)
    sliders = [read_slider(text, case) for text in options.slider] or usual_sliders(case)
    server = serve(case, sliders, title=Path(options.case).stem, port=options.port,
                   max_seconds=options.max_seconds)
    address = f"http://127.0.0.1:{server.port}/"
    print(f"{address}  (Ctrl-C ends it)", flush=True)
    if not options.no_browser:
        webbrowser.open(address)
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        print(file=sys.stderr)
    server.stop()
    return 0


def serve(case: Case, sliders: Sequence[Slider] | None = None, *, title: str = "",
          port: int = 0, max_seconds: float = 20.0) -> Any:
    """A server of the page, on this machine alone; its `io_loop.start()` begins to serve.

    Parameters
    ----------
    case : Case
        A frequency sweep.
    sliders : sequence of Slider, optional
        Keys to turn (default: those that most people turn).
    title : str
        Heading of the page.
    port : int
        Port of the loopback interface; 0: any free one.
    max_seconds : float
        A sweep is stopped after this time, within a point; what it has is shown.

    Returns
    -------
    bokeh.server.server.Server

    Raises
    ------
    InputError
        Bokeh is not installed, or the case is no natural frequency sweep.
    """
    try:
        from bokeh.application import Application
        from bokeh.application.handlers.function import FunctionHandler
        from bokeh.server.server import Server
    except ImportError:
        raise InputError("explore needs bokeh: pip install 'fretwear[explore]'") from None
    from .page import Page

    values = namelist_values(case.namelist())
    if values.get("case%analysis") != ["frf"]:
        raise InputError("explore: shows frequency sweeps; the case has analysis = "
                         f"{values.get('case%analysis', ['?'])[0]}, it must be 'frf'")
    shown = list(usual_sliders(case) if sliders is None else sliders)
    if not shown:
        raise InputError("explore: no key of the case has a single number to turn; name one, such "
                         "as --slider load%harmonic_scale=0.1:2")
    heading = values.get("case%title", [title])[0] or title or "Fretwear"

    def open_page(document: Any) -> None:
        Page(document, case, shown, heading, max_seconds)

    application = Application(FunctionHandler(open_page))
    # The address of the loopback interface: no other machine sees the page.
    server = Server({"/": application}, address="127.0.0.1", port=port)
    server.start()
    return server
