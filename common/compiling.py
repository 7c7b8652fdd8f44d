"""Changes to numba that save seconds of each run; the compiled kernels calculate the same.

Parallel loops are optimised and made into machine code once, as parts of their kernel. Numba makes a loop into four
libraries, each linked into the next: the loop's body, two wrappers, and the kernel. Each one is optimised as a whole
and made into machine code, although only that of the kernel is run.

Stored kernels are read as machine code, without the compiler and without the form in which others link them.
"""

import functools
from types import ModuleType

from common.importing import when_imported

# Beginnings of the names of the libraries that are linked into a kernel with parallel loops.
PARTS_OF_LOOPS = ("__numba_parfor_gufunc", "<numba.np.ufunc.wrappers._GufuncWrapper", "parallelgufuncwrapper")


def patch_numba() -> None:
    """Change numba, as it is imported. Nothing else has to be called."""
    when_imported("numba.core.codegen", _link_parts)
    when_imported("numba.parfors.parfor_lowering", _leave_bodies_to_kernels)
    when_imported("numba.core.codegen", _read_machine_code_alone)
    when_imported("numba.core.caching", _read_without_compiler)


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


@functools.cache
def _read_machine_code_alone(codegen: ModuleType) -> None:
    """A stored kernel runs from its machine code. Its bitcode is parsed where it is linked into another kernel.

    Until then numba does not know the names of its functions: the engine is asked for them by name.
    """
    library = codegen.CPUCodeLibrary
    unserialize, module_for_linking = library._unserialize.__func__, library._get_module_for_linking
    pointer = codegen.JITCodeLibrary.get_pointer_to_function

    def unserialize_machine_code(cls, codegen, state):
        name, kind, data = state
        if kind != "object":
            return unserialize(cls, codegen, state)
        self = codegen.create_library(name)
        machine_code, self.stored_bitcode = data
        self.enable_object_caching()
        self._set_compiled_object(machine_code)
        self._finalize_final_module()
        return self

    def parsed_module(self):
        bitcode = vars(self).pop("stored_bitcode", None)
        if bitcode is not None:
            self._shared_module = codegen.ll.parse_bitcode(bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)
        return module_for_linking(self)

    def pointer_in_machine_code(self, name):
        if "stored_bitcode" in vars(self):
            self._ensure_finalized()
            return self._codegen._engine._ee.get_function_address(name)
        return pointer(self, name)

    library._unserialize = classmethod(unserialize_machine_code)
    codegen.JITCodeLibrary.get_pointer_to_function = pointer_in_machine_code
    library._get_module_for_linking = parsed_module


@functools.cache
def _read_without_compiler(caching: ModuleType) -> None:
    """A kernel is read from its file without what numba compiles others with: that is loaded as the first one compiles.

    Its machine code needs numba's own memory of arrays alone.
    """
    from numba.core.runtime import rtsys

    def load_overload(self, sig, target_context):
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    caching.Cache.load_overload = load_overload
