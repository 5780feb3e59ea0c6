"""Which rule for heights counts for which file of a scene."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from map3d.requests.heights import BY_EVIDENCE, HeightRule, parse_heights

HEIGHTS: Final = "heights"
CLAMP: Final = "clamp"
OF_FILES: Final = "heights_of_files"
"""Keys in `SceneRecord.options`: the rule of all files, and a list of rules of some: {"heights", "clamp", "assets"}."""
NO_CLASSES: Final = "none"


@dataclass(frozen=True)
class HeightRules:
    """`of_files`: (rule, names of assets) for files that were given together; `others`: for the rest."""

    others: HeightRule
    of_files: tuple[tuple[HeightRule, frozenset[str]], ...] = ()

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> "HeightRules":
        """Reads the options of a scene. Raises BadRequest."""
        rules = tuple((_rule(entry), frozenset(entry["assets"])) for entry in options.get(OF_FILES, ()))
        return cls(_rule(options), rules)

    def groups(self, names: Sequence[str]) -> Iterator[tuple[HeightRule, frozenset[str]]]:
        """Yields each rule with those of some assets for which it counts."""
        yield from self.of_files
        yield self.others, frozenset(names).difference(*(of_rule for _, of_rule in self.of_files))


def with_choice(options: Mapping[str, Any], heights: str | None, clamp: Sequence[str]) -> dict[str, Any]:
    """Returns options with a choice for all files. None and no classes leave a choice as it is, "auto" and "none" take it back. Raises BadRequest."""
    chosen = dict(options)
    for name, value, without in ((HEIGHTS, heights, BY_EVIDENCE), (CLAMP, list(clamp), [NO_CLASSES])):
        if value == without:
            chosen.pop(name, None)
        elif value:
            chosen[name] = value
    _rule(chosen)
    return chosen


def with_choice_of_files(options: Mapping[str, Any], names: Sequence[str], heights: str | None, clamp: Sequence[str]) -> dict[str, Any]:
    """As `with_choice`, for some assets alone, whose choices so far are their own or those for all files."""
    if heights is None and not clamp:
        return dict(options)
    for_all = {name: options[name] for name in (HEIGHTS, CLAMP) if name in options}
    before = {name: entry for entry in options.get(OF_FILES, ()) for name in entry["assets"]}
    rest = [{**entry, "assets": [name for name in entry["assets"] if name not in names]} for entry in options.get(OF_FILES, ())]
    chosen: list[dict[str, Any]] = []
    for name in sorted(names):
        choice = with_choice({key: value for key, value in before.get(name, for_all).items() if key != "assets"}, heights, clamp)
        same = next((entry for entry in chosen if {**choice, "assets": entry["assets"]} == entry), None)
        if same is not None:
            same["assets"].append(name)
        elif choice != for_all:
            chosen.append({**choice, "assets": [name]})
    rules = [*(entry for entry in rest if entry["assets"]), *chosen]
    others = {name: value for name, value in options.items() if name != OF_FILES}
    return {**others, OF_FILES: rules} if rules else others


def _rule(options: Mapping[str, Any]) -> HeightRule:
    return replace(parse_heights(options.get(HEIGHTS)), clamp=tuple(options.get(CLAMP, ())))
