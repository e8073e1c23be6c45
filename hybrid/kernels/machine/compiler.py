"""How numba compiles kernels: its options, and what is done in another way than its own.

Imported when the first kernel has to be compiled (kernels.machine.kept_code).  Tried with numba 0.62.0 and 0.68.1.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
from llvmlite import binding as llvm
from numba.core import ir, postproc, transforms, typed_passes, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.registry import CPUDispatcher
from numba.core.types.functions import BaseFunction

from hybrid.kernels.machine import reference_types
from hybrid.kernels.machine.linked_code import Code

# numba's "contract" lets a*b+c become one fused instruction; no other relaxation is
# allowed: NaN must stay visible and the order of sums must stay as written.
# Kernels release the GIL: runs in threads of one process share no array that they write.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
_OPTIONS |= {"no_cfunc_wrapper": True, "nogil": True}
_njit: Any = numba.njit  # its type knows of fewer options than it takes


_find_rule: Any = BaseFunction.get_call_type
_rules: dict[Any, Any] = {}


def _rule_of(function: Any, context: Any, args: Any, named: Any) -> Any:
    """The rule by which numba types a call, found once for the same numbers: a sixth of the time goes into finding it."""
    if named or not all(isinstance(x, types.Number | types.Boolean) for x in args):
        return _find_rule(function, context, args, named)
    key = function, args
    if key not in _rules:
        _rules[key] = _find_rule(function, context, args, named)
    return _rules[key]


_base: Any = BaseFunction  # whose types know of no other rule
_base.get_call_type = _rule_of


_finish_pass: Any = postproc.PostProcessor.run


def _finish(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """What numba does after each pass, but for what kernels have no use for: which variables live where."""
    function = self.func_ir
    if function.func_id.modname.startswith("hybrid.") and not function.is_generator:
        function.blocks = transforms.canonicalize_cfg(function.blocks)
        function.variable_lifetime = postproc.VariableLifetime(function.blocks)
        if emit_dels:
            self._insert_var_dels(extend_lifetimes=extend_lifetimes)
    else:  # a user's, maybe of Python's objects
        _finish_pass(self, emit_dels, extend_lifetimes)


def _list_variables(self: Any, value: Any) -> list[Any]:
    """The variables in a part of an instruction, as numba lists them, but in one list for all that is in it."""
    found: list[Any] = []
    _add_variables(value, found)
    return found


def _add_variables(value: Any, found: list[Any]) -> None:
    if isinstance(value, ir.Var):
        found.append(value)
    elif isinstance(value, ir.Inst):
        found += value.list_vars()
    elif isinstance(value, (list, tuple)):
        for x in value:
            _add_variables(x, found)
    elif isinstance(value, dict):
        for x in value.values():
            _add_variables(x, found)


_post: Any = postproc.PostProcessor
_post.run = _finish  # both together are an eighth of the time in which numba reads a function
_instruction: Any = ir.Inst
_instruction._rec_list_vars = _list_variables


class _Kernel(CPUDispatcher):
    def get_call_template(self, args: Any, kws: Any) -> Any:
        """A constant counts as any other value of its type: f(x, 0) and f(x, 1) are compiled once."""
        return super().get_call_template([numba.types.unliteral(x) for x in args], kws)

    def compile(self, sig: Any) -> Any:
        """Without searches for garbage: a fifth of the time."""
        if not gc.isenabled():
            return super().compile(sig)
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            gc.enable()


class _NoEnvironment:
    def set_env(self, name: str, environment: Any) -> None:
        """The environment is for objects of Python, of which kernels use none."""


class _InlinedCode(JITCodeLibrary):
    """LLVM code of one function that kernels call, without what it calls itself.

    numba would optimise it together with all of that, and make machine code of it, at every level of calls anew; only
    the machine code of entries is ever executed.
    """

    codegen = _NoEnvironment()

    def finalize(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _get_module_for_linking(self) -> Any:
        """With all that it calls: for a function of numba that is none of ours."""
        whole = super()._get_module_for_linking().clone()
        _link(self, whole)
        return whole


class _CalledCode(_InlinedCode):
    """The same of a function that stays one: LLVM would inline it wherever it is called."""

    def add_ir_module(self, module: Any) -> None:
        for function in module.functions:
            if not function.is_declaration:
                function.attributes.add("noinline")
        super().add_ir_module(module)


class _EntryCode(JITCodeLibrary):
    """Code of an entry with all that it calls: optimised together, once."""

    def finalize(self) -> None:
        self._link_all()
        self._linking_libraries = []
        super().finalize()

    def _link_all(self) -> None:
        _link(self, self._final_module)


class _LooseCode(_EntryCode):
    """The same, of which the optimiser decides what it inlines."""

    def _link_all(self) -> None:
        super()._link_all()
        self._final_module = llvm.parse_assembly(str(self._final_module).replace(" alwaysinline ", " inlinehint "))


def _link(code: Any, module: Any) -> None:
    """Link into a module all that the code calls, each once."""
    found: dict[Any, None] = {}  # in order

    def collect(calling: Any) -> None:
        for called in calling._linking_libraries:
            if called not in found:
                found[called] = None
                if isinstance(called, _InlinedCode):
                    collect(called)

    collect(code)
    for called in found:
        if hasattr(code, "_reload_init"):  # numba 0.62 has none
            code._reload_init.update(called._reload_init)
        module.link_in(JITCodeLibrary._get_module_for_linking(called), preserve=True)


# What kernels have nothing for: contexts, functions that are defined or inlined within them, literal_unroll and literally.
_IDLE: tuple[Any, ...]
_IDLE = (untyped_passes.WithLifting, untyped_passes.MakeFunctionToJitFunction, untyped_passes.InlineInlinables)
_IDLE += (untyped_passes.FindLiterallyCalls, untyped_passes.LiteralUnroll, typed_passes.InlineOverloads)
_IDLE += (untyped_passes.LiteralPropagationSubPipelinePass,)


class _EntryCompiler(Compiler):
    made: type = _EntryCode

    def define_pipelines(self) -> list[Any]:
        """As numba's, without passes that would look for nothing."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [x for x in passes.passes if x[0] not in _IDLE]
        passes.finalize()
        return [passes]

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        library = self.made(target.codegen(), "hybrid")
        library.enable_object_caching()
        super().__init__(typing, target, library, *rest)


class _LooseCompiler(_EntryCompiler):
    made = _LooseCode


class _InnerCompiler(_EntryCompiler):
    made = _InlinedCode


class _CalledCompiler(_EntryCompiler):
    made = _CalledCode


class Made(NamedTuple):
    """An entry as numba has compiled it."""

    result: Any  # as numba calls it
    processor: tuple[str, str, str]  # that it is for, as kernels.machine.cache.Processor

    @property
    def code(self) -> bytes:
        """The object, which kernels.machine.linked_code.link takes."""
        self.result.library._ensure_finalized()
        return self.result.library._get_compiled_object()

    @property
    def names(self) -> dict[str, str]:
        """Of what is in the object."""
        described = self.result.fndesc
        return {
            "symbol": described.mangled_name,
            "wrapper": described.llvm_cpython_wrapper_name,
            "environment": described.env_name,
        }

    @property
    def is_bound(self) -> bool:
        """Whether it refers to something of this process: to Python's objects, or into numba's libraries."""
        made = self.result
        return bool(made.lifted or made.reload_init or made.environment.consts or made.library.has_dynamic_globals)

    def code_here(self) -> Code:
        """What numba has linked in this process."""
        entry, symbol = self.result.entry_point, self.result.fndesc.llvm_func_name
        return Code(lambda args: entry(*args), self.result.library.get_pointer_to_function(symbol))


def compile_entry(
    function: Callable[..., Any], key: tuple[Any, ...], inlined: bool, returned: tuple[Any, ...] = ()
) -> Made:
    """key: of the types of its arguments (kernels.machine.references); inlined: all that it calls; returned: an example."""
    entry = _njit(pipeline_class=_EntryCompiler if inlined else _LooseCompiler, **_OPTIONS)(function)
    entry.__class__ = _Kernel
    sig: Any = tuple(map(reference_types.type_for, key))
    if returned:
        sig = numba.typeof(returned[0])(*sig)
    entry.compile(sig)
    (result,) = entry.overloads.values()
    return Made(result, result.library.codegen.magic_tuple())


def inner_of(function: Callable[..., Any], apart: bool, options: dict[str, Any]) -> Any:
    """Of a function that only kernels call; apart: whether it stays a function of its own in their code."""
    compiler = _CalledCompiler if apart else _InnerCompiler
    made = _njit(no_cpython_wrapper=True, pipeline_class=compiler, **(_OPTIONS | options))(function)
    made.__class__ = _Kernel
    return made
