"""The stub says what the compiled module has, no more and no less."""

import ast
import inspect
from pathlib import Path

import pytest

from map3d import _core

STUB = ast.parse(Path(_core.__file__).with_name("_core.pyi").read_text())


def stub_classes() -> dict[str, ast.ClassDef]:
    return {node.name: node for node in STUB.body if isinstance(node, ast.ClassDef)}


def test_every_public_name_is_in_both() -> None:
    functions = {node.name for node in STUB.body if isinstance(node, ast.FunctionDef)}
    constants = {node.target.id for node in STUB.body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)}
    aliases = {target.id for node in STUB.body if isinstance(node, ast.Assign) for target in node.targets if isinstance(target, ast.Name)}
    declared = functions | set(stub_classes()) | constants
    compiled = {name for name in dir(_core) if not name.startswith("__")} | {"__version__"}
    assert declared - aliases == compiled


@pytest.mark.parametrize("name", sorted(stub_classes()))
def test_a_class_has_the_members_of_its_stub(name: str) -> None:
    compiled = getattr(_core, name)
    if issubclass(compiled, Exception):
        assert [base.id for base in stub_classes()[name].bases if isinstance(base, ast.Name)] == [compiled.__base__.__name__]
        return
    declared = {node.name for node in stub_classes()[name].body if isinstance(node, ast.FunctionDef)} - {"__init__"}
    found = {member for member, _ in inspect.getmembers(compiled) if not member.startswith("_")} | (declared & {"__iter__", "__next__"})
    assert declared == found


@pytest.mark.parametrize("node", [n for n in STUB.body if isinstance(n, ast.FunctionDef)], ids=lambda n: n.name)
def test_a_function_takes_the_parameters_of_its_stub(node: ast.FunctionDef) -> None:
    compiled = inspect.signature(getattr(_core, node.name))
    assert [argument.arg for argument in node.args.args] == list(compiled.parameters)
