"""What f2py makes of python/extension (wrapper.f90, functions.f90): see there for arguments."""

from typing import Any

class _Routines:
    def __getattr__(self, name: str) -> Any: ...

fw_python: _Routines
fw_python_functions: _Routines
