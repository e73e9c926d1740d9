"""What f2py makes of python/extension/wrapper.f90: see there for every argument."""

from typing import Any

class _Routines:
    def __getattr__(self, name: str) -> Any: ...

fw_python: _Routines
