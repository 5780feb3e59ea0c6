"""The stub file declares exactly what the compiled module has: names, classes with their members, and signatures with their defaults."""

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d import _core

STUB = ast.parse(Path(_core.__file__).with_name("_core.pyi").read_text())
CLASSES = {node.name: node for node in STUB.body if isinstance(node, ast.ClassDef)}
FUNCTIONS = {node.name: node for node in STUB.body if isinstance(node, ast.FunctionDef)}
CONSTANTS = {node.target.id: node.annotation for node in STUB.body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)}
PLAIN_TYPES = {"str": str, "int": int, "float": float}
PROTOCOL = {"__iter__", "__next__"}
ANY_DEFAULT = "..."

Parameter = tuple[str, object, bool]
"""Name; default: `inspect.Parameter.empty` without one, ANY_DEFAULT for one that the stub does not spell out; whether it is passed by name only."""


def is_exception(name: str) -> bool:
    return issubclass(getattr(_core, name), Exception)


def has_decorator(node: ast.FunctionDef | ast.ClassDef, name: str) -> bool:
    return any(isinstance(decorator, ast.Name) and decorator.id == name for decorator in node.decorator_list)


def declared_parameters(node: ast.FunctionDef) -> list[Parameter]:
    """Returns the parameters of a stub's function without `self`."""
    arguments = node.args
    assert not any((arguments.vararg, arguments.kwarg, arguments.posonlyargs)), f"{node.name}: plain parameters only"
    names = [argument.arg for argument in arguments.args]
    defaults = [declared_default(value) for value in arguments.defaults]
    plain = zip(names, [inspect.Parameter.empty] * (len(names) - len(defaults)) + defaults, strict=True)
    named = zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
    rows = [(name, default, False) for name, default in plain] + [(argument.arg, declared_default(value), True) for argument, value in named]
    return [row for row in rows if row[0] != "self"]


def declared_default(value: ast.expr | None) -> object:
    if value is None:
        return inspect.Parameter.empty
    return ANY_DEFAULT if ast.unparse(value) == ANY_DEFAULT else ast.literal_eval(value)


def compiled_parameters(callable_: object) -> list[Parameter]:
    signature = inspect.signature(callable_)  # type: ignore[arg-type]
    by_name = inspect.Parameter.KEYWORD_ONLY
    return [(name, parameter.default, parameter.kind is by_name) for name, parameter in signature.parameters.items() if name != "self"]


def check_parameters(node: ast.FunctionDef, compiled: object) -> None:
    declared, found = declared_parameters(node), compiled_parameters(compiled)
    assert [(name, by_name) for name, _, by_name in declared] == [(name, by_name) for name, _, by_name in found]
    for (name, expected, _), (_, default, _) in zip(declared, found, strict=True):
        if expected == ANY_DEFAULT:
            assert default is not inspect.Parameter.empty, f"{name} has no default"
        else:
            assert (default, type(default)) == (expected, type(expected)), f"default of {name}"


def methods() -> Iterator[tuple[str, ast.FunctionDef]]:
    for name, node in CLASSES.items():
        for member in node.body:
            if isinstance(member, ast.FunctionDef) and not has_decorator(member, "property") and member.name not in PROTOCOL:
                yield name, member


def test_every_public_name_is_in_both() -> None:
    declared = {name for name in (*FUNCTIONS, *CLASSES, *CONSTANTS) if not name.startswith("_")}
    compiled = {name for name in dir(_core) if not name.startswith("_")}
    assert declared == compiled
    assert "__version__" in CONSTANTS


@pytest.mark.parametrize("name", CONSTANTS)
def test_a_constant_has_its_type(name: str) -> None:
    value, annotation = getattr(_core, name), ast.unparse(CONSTANTS[name])
    if annotation.startswith("tuple["):
        assert annotation == f"tuple[{', '.join(type(item).__name__ for item in value)}]"
    elif annotation.startswith("dict["):
        assert {annotation} == {f"dict[{type(key).__name__}, {type(item).__name__}]" for key, item in value.items()}
    else:
        assert type(value) is PLAIN_TYPES[annotation]


@pytest.mark.parametrize("name", CLASSES)
def test_a_class_has_the_members_of_its_stub(name: str) -> None:
    compiled, node = getattr(_core, name), CLASSES[name]
    if is_exception(name):
        assert [ast.unparse(base) for base in node.bases] == [compiled.__base__.__name__]
        return
    members = [member for member in node.body if isinstance(member, ast.FunctionDef)]
    declared = {member.name for member in members} - {"__init__"}
    assert declared == {member for member in vars(compiled) if not member.startswith("_")} | (vars(compiled).keys() & PROTOCOL)
    properties = {member.name for member in members if has_decorator(member, "property")}
    assert properties == {member for member, value in vars(compiled).items() if inspect.isgetsetdescriptor(value)}


@pytest.mark.parametrize("name", [name for name in CLASSES if not is_exception(name)])
def test_a_class_is_final_and_constructible_as_its_stub_says(name: str) -> None:
    compiled, node = getattr(_core, name), CLASSES[name]
    assert has_decorator(node, "final")
    with pytest.raises(TypeError):
        type("Derived", (compiled,), {})
    if not any(isinstance(member, ast.FunctionDef) and member.name == "__init__" for member in node.body):
        with pytest.raises(TypeError):
            compiled()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_has_the_signature_of_its_stub(name: str) -> None:
    check_parameters(FUNCTIONS[name], getattr(_core, name))


@pytest.mark.parametrize(("name", "node"), list(methods()), ids=lambda value: getattr(value, "name", value))
def test_a_method_has_the_signature_of_its_stub(name: str, node: ast.FunctionDef) -> None:
    compiled = getattr(_core, name)
    check_parameters(node, compiled if node.name == "__init__" else getattr(compiled, node.name))
