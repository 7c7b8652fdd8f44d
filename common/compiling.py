"""Parallel loops are optimised and made into machine code once, as parts of their kernel.

The compiled kernels calculate the same. Numba makes a parallel loop into four libraries, each linked into the next: the
loop's body, two wrappers, and the kernel. Each one is optimised as a whole and made into machine code, although only
that of the kernel is run.
"""

import functools
from types import ModuleType

from common.importing import when_imported

# Beginnings of the names of the libraries that are linked into a kernel with parallel loops.
PARTS_OF_LOOPS = ("__numba_parfor_gufunc", "<numba.np.ufunc.wrappers._GufuncWrapper", "parallelgufuncwrapper")


def compile_loops_once() -> None:
    """Change numba, as it is imported. Nothing else has to be called."""
    when_imported("numba.core.codegen", _link_parts)
    when_imported("numba.parfors.parfor_lowering", _leave_bodies_to_kernels)


@functools.cache  # once
def _link_parts(codegen: ModuleType) -> None:
    """Parts of loops are linked as they are: their kernel is optimised, and only that is made into machine code."""
    library = codegen.CPUCodeLibrary
    optimize, make_usable = library._optimize_final_module, library._finalize_final_module

    def optimize_unless_part(self) -> None:
        if not self.name.startswith(PARTS_OF_LOOPS):
            optimize(self)

    def make_usable_or_linkable(self) -> None:
        if self.name.startswith(PARTS_OF_LOOPS):
            self._finalize_dynamic_globals()
            self._finalized = True
        else:
            make_usable(self)

    library._optimize_final_module, library._finalize_final_module = optimize_unless_part, make_usable_or_linkable


@functools.cache
def _leave_bodies_to_kernels(lowering: ModuleType) -> None:
    """Nothing but its kernel calls the body of a loop: it needs no address, and no wrapper for Python."""
    create = lowering._create_gufunc_for_parfor_body

    def create_uncalled(lowerer, parfor, typemap, typingctx, targetctx, flags, *arguments, **options):
        flags.no_compile = flags.no_cpython_wrapper = True
        return create(lowerer, parfor, typemap, typingctx, targetctx, flags, *arguments, **options)

    lowering._create_gufunc_for_parfor_body = create_uncalled  # type: ignore[attr-defined]
