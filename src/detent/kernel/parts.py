"""Code of steps that only other steps call: it is linked into what Python calls, and made machine code there, once.

Numba makes machine code of every function by itself, and optimises it again, with all that it calls, in each of its
callers: a step at the bottom of an axis a dozen times. A part stays as it was lowered. What Python calls takes the
parts that it reaches, each once, callers before what they call, and is optimised as a whole.
"""

# Numba publishes no types of its compiler, two classes of which are extended here.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false

from collections.abc import Iterator
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class StepLibrary(JITCodeLibrary):
    """What a step was lowered to, and what it calls."""

    def __init__(self, code: Any, name: str, *, only_part: bool) -> None:
        super().__init__(code, name)
        self._code = code
        self.is_part = only_part
        self.environments: dict[str, Any] = {}  # of numba, under their names in the code; they stay alive with it

    def finalize(self) -> None:
        """End the lowering; of what is no part, make machine code."""
        if self.is_part:
            self._finalize_dynamic_globals()
            self._finalized = True
            return
        others = [library for library in self._linking_libraries if not is_part(library)]
        for part in self.parts():
            self._final_module.link_in(part.own_module(), preserve=True)
            self._reload_init.update(part._reload_init)  # noqa: SLF001 - as numba does
            others += [library for library in part._linking_libraries if not is_part(library)]  # noqa: SLF001
        self._linking_libraries = others
        super().finalize()

    def parts(self) -> "Iterator[StepLibrary]":
        """All parts that this reaches, callers before what they call: the linker takes nothing that is not called."""
        found: list[StepLibrary] = []
        seen: set[int] = set()

        def visit(library: Any) -> None:
            """Those below first."""
            for one in library._linking_libraries:  # noqa: SLF001 - of this class
                if is_part(one) and id(one) not in seen:
                    seen.add(id(one))
                    visit(one)
                    found.append(one)

        visit(self)
        return reversed(found)

    def own_module(self) -> Any:
        """The code of this part alone, for linking."""
        return super()._get_module_for_linking()

    def _get_module_for_linking(self) -> Any:
        """The code for a library of numba's, which knows no parts: with all that it calls."""
        module = self.own_module()
        if not self.is_part:
            return module
        whole = module.clone()
        for part in self.parts():
            whole.link_in(part.own_module(), preserve=True)
        return whole

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function; 0, as for one that is not there, in a part."""
        return 0 if self.is_part else super().get_pointer_to_function(name)

    @property
    def codegen(self) -> Any:
        """What makes machine code; in that of a part there is no place for an environment yet."""
        return _Placeless(self, self._code) if self.is_part else self._code

    def place_environments(self) -> None:
        """Write the addresses of the environments of all parts into the machine code that has places for them."""
        found = dict(item for part in self.parts() for item in part.environments.items())
        for place in self._final_module.global_variables:
            if place.name in found:
                self._code.set_env(place.name, found[place.name])


class _Placeless:
    """What makes machine code, but keeps an environment for later."""

    def __init__(self, library: StepLibrary, code: Any) -> None:
        self._library, self._code = library, code

    def set_env(self, name: str, environment: Any) -> None:
        """Keep it with the part."""
        self._library.environments[name] = environment

    def __getattr__(self, name: str) -> Any:
        return getattr(self._code, name)


def is_part(library: Any) -> bool:
    """True for the code of a step that only steps call."""
    return isinstance(library, StepLibrary) and library.is_part


class StepCompiler(Compiler):
    """Numba's, which lowers into a `StepLibrary`: a part where Python shall not call it."""

    def __init__(self, typing: Any, target: Any, library: Any, *told: Any) -> None:
        *_, flags, _ = told  # kinds of the arguments and of the result, how to compile, kinds of variables
        if library is None:
            library = StepLibrary(target.codegen(), "step", only_part=bool(flags.no_cpython_wrapper))
            library.enable_object_caching()
        super().__init__(typing, target, library, *told)
