# SPDX-License-Identifier: LGPL-2.1-or-later
"""Recipes of data sets: videos, simulator, and parameters drawn for each video."""
from __future__ import annotations

import collections
import dataclasses
import glob
import hashlib
import math
import os
import re
import reprlib
import statistics
from fractions import Fraction
from typing import Any, Iterable, Iterator, Mapping, Optional

import yaml

from .pipeline import Gst, Pipeline, PipelineError, expect_limits, printable, property_limits, quoted
from .recipe_elements import is_safe_property, reason_against
from .recordings import WRITERS

Value = float | int | str | bool

MAX_RECIPE = 1 << 17  # bytes; YAML is parsed at about 50 kB a second
MAX_CHOICES = 1000
MAX_NUMBER = 64  # characters
FLOAT = "tag:yaml.org,2002:float"
NUMBERS = {"tag:yaml.org,2002:int", FLOAT}
MAX_SEED = 2**64 - 1
MAX_DRAWS = 1000
PICTURES = {".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".png": "image/png"}
TENSORS = "tensors"
OUTPUTS = sorted(extension[1:] for extension in WRITERS) + [TENSORS]
KEYS = {"seed", "videos", "framerate", "window", "frames", "simulator", "parameters", "filters", "output", "tensors",
        "split", "group", "min-frames"}
FRAMERATE = re.compile(r"[0-9]{1,20}([./][0-9]{1,20})?")
DISTRIBUTIONS = {"uniform": "[minimum, maximum]", "log-uniform": "[minimum, maximum], both above 0",
                 "normal": "[mean, standard deviation]", "choice": "a list of values"}


class RecipeError(ValueError):
    """An error in a recipe; the text says where and what it is, and what is allowed."""


class _Loader(yaml.SafeLoader):
    """Refuses duplicate keys, excessively long numbers, and merges, which may grow with each level."""

    def construct_scalar(self, node: yaml.ScalarNode) -> Any:
        if node.tag in NUMBERS and len(node.value) > MAX_NUMBER:
            raise RecipeError(f"line {node.start_mark.line + 1}: a number has {len(node.value)} characters;"
                              f" write at most {MAX_NUMBER}")
        return super().construct_scalar(node)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        counts = collections.Counter(str(key.value) for key, _ in node.value)
        if twice := [name for name, count in counts.items() if count > 1]:
            raise RecipeError(f"line {node.start_mark.line + 1}: {min(twice)} is given twice")
        if any(key.tag == "tag:yaml.org,2002:merge" for key, _ in node.value):
            raise RecipeError(f"line {node.start_mark.line + 1}: << is not for recipes; write the keys")
        return super().construct_mapping(node, deep)


# YAML 1.1 takes 1e9 for text; YAML 1.2 does not.
_Loader.add_implicit_resolver(FLOAT, re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$"), list("-+0123456789"))


def uniform_number(*key: str | int) -> float:
    """A number between 0 and 1, both excluded, from the hash of the key."""
    digest = hashlib.sha256("\0".join(map(str, key)).encode()).digest()
    return (int.from_bytes(digest[:8], "big") // 2**11 + 0.5) / 2**53


def rounded(value: float) -> float:
    """Rounds to six significant digits, since the last bits of a logarithm depend on the machine."""
    return float(f"{value:.6g}")


@dataclasses.dataclass(frozen=True)
class Distribution:
    """Distribution of a parameter; its draws are factors of the parameter `relative_to`, if given."""

    kind: str
    values: tuple[Value, ...]
    relative_to: Optional[str] = None

    def at(self, share: float) -> Value:
        """The quantile of this share; for a choice, the value at this share of the list."""
        if self.kind == "choice":
            return self.values[int(share * len(self.values))]
        first, second = (float(value) for value in self.values)
        if self.kind == "uniform":
            return first + (second - first) * share
        if self.kind == "log-uniform":
            return math.exp(math.log(first) + (math.log(second) - math.log(first)) * share)
        return statistics.NormalDist(first, second).inv_cdf(share) if second > 0 else first


@dataclasses.dataclass(frozen=True)
class Window:
    """A window that moves over a picture: right, down, left and up again, one pixel a frame."""

    width: int
    height: int
    distance: int

    def corners(self) -> Iterator[tuple[int, int]]:
        """Left and upper edge of the window in each frame."""
        end = self.distance
        yield from ((i, 0) for i in range(end))
        yield from ((end, i) for i in range(end))
        yield from ((end - i, end) for i in range(end))
        yield from ((0, end - i) for i in range(end + 1))


@dataclasses.dataclass(frozen=True)
class Recipe:
    """A checked recipe; Recipe.load() reads one. Raises RecipeError."""

    path: str
    seed: int
    videos: tuple[str, ...]
    simulator: str
    outputs: tuple[str, ...]
    framerate: Optional[Fraction] = None
    window: Optional[Window] = None
    frames: str = ""
    parameters: Mapping[str, Value | Distribution] = dataclasses.field(default_factory=dict)
    filters: str = ""
    tensors: str = ""
    split: Mapping[str, float] = dataclasses.field(default_factory=dict)
    group: str = ""
    min_frames: int = 2

    @classmethod
    def load(cls, path: str | os.PathLike[str], trust: bool = False) -> Recipe:
        """Reads a recipe. Without `trust`, only elements that neither open files nor send anything may occur."""
        try:
            with open(path, "rb") as file:
                text = file.read(MAX_RECIPE + 1)
            if len(text) > MAX_RECIPE:
                raise RecipeError("too long for a recipe")
            return _checked(os.path.abspath(path), yaml.load(text, _Loader), trust)
        except (OSError, UnicodeError, RecursionError, ValueError, yaml.YAMLError) as error:
            raise RecipeError(f"{os.fspath(path)}: {_text_of(error)}") from None

    def inputs(self) -> dict[str, str]:
        """The path of each video or folder of pictures, by its name: the path from the first folder of the
        pattern that has a wildcard, without extension. Sorted by name."""
        found: dict[str, str] = {}
        for pattern in self.videos:
            base = _fixed_folder(pattern)
            folder = os.path.join(os.path.dirname(self.path), base)
            matches = glob.glob(os.path.relpath(pattern, base or "."), root_dir=folder, recursive=True)
            for match in sorted(matches):
                path = os.path.join(folder, match)
                if os.path.isdir(path) and not any(map(is_picture, os.listdir(path))):
                    continue
                if os.path.exists(path) and not os.path.isdir(path) and not os.path.isfile(path):  # such as a pipe
                    continue
                name = match if os.path.isdir(path) else os.path.splitext(match)[0]
                _check_name(name, path)
                if found.setdefault(name, path) != path:
                    raise RecipeError(f"videos: {found[name]} and {path} have the same name, {name}; rename one")
        if not found:
            raise RecipeError(f"videos: no file matches {' or '.join(self.videos)}")
        return dict(sorted(found.items()))

    def drawn(self, name: str) -> dict[str, Value]:
        """The parameters of a video. They only depend on seed, name and their own distributions."""
        drawn: dict[str, Value] = {}
        limits = property_limits(self.simulator)
        for parameter in _in_order(self.parameters):
            value = self.parameters[parameter]
            drawn[parameter] = value if not isinstance(value, Distribution) else self._draw(
                name, parameter, value, drawn, limits)
        if "seed" in limits and "seed" not in drawn and not re.search(r"\bseed=", self.simulator):
            drawn["seed"] = int(uniform_number(self.seed, name, "seed") * 2**53)
        return drawn

    def _draw(self, name: str, parameter: str, distribution: Distribution, drawn: Mapping[str, Value],
              limits: Mapping[str, tuple[float, float]]) -> Value:
        """Draws a value, again if it is outside the limits of the property, as from a normal distribution."""
        low, high = limits[parameter]
        for attempt in range(MAX_DRAWS):
            value = distribution.at(uniform_number(self.seed, name, parameter, attempt))
            if distribution.relative_to:
                value = float(value) * float(drawn[distribution.relative_to])
            elif distribution.kind == "choice":
                return value
            value = rounded(float(value))
            if isinstance(low, int) and math.isfinite(value):
                value = int(value)
            if low <= value <= high:
                return value
        raise RecipeError(f"parameters: {parameter} is hardly ever within {low:g} to {high:g}")

    def line(self, parameters: Mapping[str, Value]) -> str:
        """The elements from frames to events, in the syntax of gst-launch-1.0."""
        values = [f"{name}={_written(value)}" for name, value in parameters.items()]
        elements = [self.frames, " ".join([self.simulator, *values]), self.filters]
        return " ! ".join(filter(None, elements))

    def parts(self, names: Iterable[str]) -> dict[str, str]:
        """The part of the data set that each video belongs to, such as "train"; empty without split. In random order
        within each folder, a group goes to the part that lacks most of its share."""
        groups: dict[str, list[str]] = {}
        for name in sorted(names):
            match = re.search(self.group, name) if self.group else None
            groups.setdefault(match.group() if match else name, []).append(name)

        def place(group: str) -> tuple[float, float]:
            folder = os.path.dirname(groups[group][0])
            return uniform_number(self.seed, folder, "folder"), uniform_number(self.seed, group, "split")

        total = sum(map(len, groups.values()))
        sizes = _whole_sizes(self.split, total)
        parts: dict[str, str] = {}
        counts = dict.fromkeys(sizes, 0)
        for group in sorted(groups, key=place):
            share = (len(parts) + len(groups[group])) / total
            part = max(sizes, key=lambda part: sizes[part] * share - counts[part], default="")
            parts |= dict.fromkeys(groups[group], part)
            counts[part] = counts.get(part, 0) + len(groups[group])
        return parts


def _whole_sizes(shares: Mapping[str, float], total: int) -> dict[str, int]:
    """The numbers of videos that come closest to these shares, by the largest remainder."""
    sizes = {part: math.floor(share * total + 1e-6) for part, share in shares.items()}
    remainders = sorted(shares, key=lambda part: sizes[part] - shares[part] * total)
    for part in remainders[:total - sum(sizes.values())]:
        sizes[part] += 1
    return sizes


def is_picture(name: str) -> bool:
    return os.path.splitext(name)[1].lower() in PICTURES


def _written(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return quoted(value) if isinstance(value, str) else f"{value:.6g}" if isinstance(value, float) else str(value)


def _text_of(error: Exception) -> str:
    return " ".join(str(error).split()) if not isinstance(error, OSError) else str(error.strerror)


def _fixed_folder(pattern: str) -> str:
    """The folders of a pattern before the first wildcard."""
    folders = os.path.dirname(pattern).split("/")
    fixed = next((i for i, folder in enumerate(folders) if glob.has_magic(folder)), len(folders))
    return "/".join(folders[:fixed]) or ("/" if pattern.startswith("/") else "")


def _check_name(name: str, path: str) -> None:
    if name != printable(name):
        raise RecipeError(f"videos: the name {printable(path)} is not UTF-8; rename it")
    if re.search(r"[\x00-\x1f{}]|^/|(^|/)\.\.?(/|$)", name) or not name.isprintable():
        raise RecipeError(f"videos: {name!r} has braces, control characters or dots that file names of a data set"
                          " cannot have; rename it")


def _in_order(parameters: Mapping[str, Value | Distribution]) -> list[str]:
    """Parameter names; relative parameters come last."""
    return sorted(parameters, key=lambda name: (getattr(parameters[name], "relative_to", None) is not None, name))


def _checked(path: str, recipe: Any, trust: bool) -> Recipe:
    if not isinstance(recipe, dict):
        raise RecipeError("not a recipe: give keys and values, such as \"seed: 1\"")
    _expect_keys("", recipe, KEYS)
    videos = recipe.get("videos")
    patterns = [videos] if isinstance(videos, str) else videos
    if not isinstance(patterns, list) or not patterns or not all(isinstance(one, str) and one for one in patterns):
        raise RecipeError("videos: give a pattern such as \"videos/**/*.mp4\", or a list of patterns")
    seed = recipe.get("seed", 0)
    _expect_number("seed", seed, 0, MAX_SEED, whole=True)
    min_frames = recipe.get("min-frames", 2)
    _expect_number("min-frames", min_frames, 2, 10**9, whole=True)
    texts = {key: _text(recipe, key) for key in ("simulator", "frames", "filters", "tensors", "group")}
    outputs = _outputs(recipe)
    if texts["tensors"] and TENSORS not in outputs:
        raise RecipeError("tensors: only for output: tensors")
    if not texts["simulator"]:
        raise RecipeError("simulator: give an element and its properties, such as \"eventsim-dvs preset=davis346\"")
    if "!" in texts["simulator"]:
        raise RecipeError("simulator: give one element; others belong to frames, before it, or filters, after it")
    if not trust:
        _expect_safe(texts)
    if not Gst.ElementFactory.find(texts["simulator"].split()[0]):
        raise RecipeError(f"simulator: there is no element \"{texts['simulator'].split()[0]}\"")
    checked = Recipe(path, seed, tuple(patterns), texts["simulator"], outputs, _framerate(recipe), _window(recipe),
                     texts["frames"], _parameters(recipe, texts["simulator"], trust), texts["filters"], texts["tensors"],
                     _split(recipe), texts["group"], min_frames)
    if checked.window and not checked.framerate:
        raise RecipeError("window: give a framerate, too")
    if checked.group and not checked.split:
        raise RecipeError("group: only with split")
    try:
        re.compile(checked.group)
    except re.error as error:
        raise RecipeError(f"group: {error}") from None
    _check_elements(checked)
    return checked


def _expect_safe(texts: Mapping[str, str]) -> None:
    chains = {key: texts[key] for key in ("frames", "simulator", "filters")} | {
        "tensors": f"eventtensor {texts['tensors']}"}
    if "!" in texts["tensors"]:
        raise RecipeError("tensors: give properties of eventtensor")
    for key, chain in chains.items():
        if reason := reason_against(chain):
            raise RecipeError(f"{key}: {reason}; if you trust the recipe, run it with --trust")


def _expect_keys(where: str, given: Mapping[Any, Any], known: set[str]) -> None:
    if unknown := [key for key in given if key not in known]:
        raise RecipeError(f"{where}unknown key {unknown[0]}; known are {', '.join(sorted(known))}")


def _expect_number(where: str, value: Any, low: float, high: float, whole: bool = False) -> None:
    kinds: tuple[type, ...] = (int,) if whole else (int, float)
    if isinstance(value, bool) or not isinstance(value, kinds) or not low <= value <= high:
        number = "whole number" if whole else "number"
        raise RecipeError(f"{where}: {reprlib.repr(value)} is not a {number} from {low:g} to {high:g}")


def _text(recipe: Mapping[str, Any], key: str) -> str:
    value = recipe.get(key, "")
    if not isinstance(value, str):
        raise RecipeError(f"{key}: {reprlib.repr(value)} is not text")
    return value.strip()


def _outputs(recipe: Mapping[str, Any]) -> tuple[str, ...]:
    given = recipe.get("output", "h5")
    outputs = [str(output).strip().removeprefix(".") for output in (given if isinstance(given, list) else [given])]
    if wrong := [output for output in outputs if output not in OUTPUTS]:
        raise RecipeError(f"output: {reprlib.repr(wrong[0])} is none of {', '.join(OUTPUTS)}")
    if {"npy", TENSORS} <= set(outputs):
        raise RecipeError("output: npy and tensors would be the same files")
    if not outputs or len(set(outputs)) < len(outputs):
        raise RecipeError("output: give each format once")
    return tuple(outputs)


def _framerate(recipe: Mapping[str, Any]) -> Optional[Fraction]:
    if "framerate" not in recipe:
        return None
    text = str(recipe["framerate"]) if isinstance(recipe["framerate"], (int, float, str)) else ""
    try:
        # No exponents: 1e500000000 would take all memory.
        framerate = Fraction(text if FRAMERATE.fullmatch(text) else 0)
    except ZeroDivisionError:
        framerate = Fraction(0)
    if not 0 < framerate <= 1_000_000 or framerate.denominator >= 2**31 or framerate.numerator >= 2**31:
        raise RecipeError(f"framerate: {reprlib.repr(recipe['framerate'])} is not frames per second, such as 30 or"
                          " 30000/1001")
    return framerate


def _window(recipe: Mapping[str, Any]) -> Optional[Window]:
    given = recipe.get("window")
    if given is None:
        return None
    keys = {"width", "height", "distance"}
    if not isinstance(given, dict) or set(given) != keys:
        raise RecipeError("window: give width, height and distance, in pixels")
    for key in sorted(keys):
        _expect_number(f"window: {key}", given[key], 1, 4096, whole=True)
    return Window(**given)


def _parameters(recipe: Mapping[str, Any], simulator: str, trust: bool) -> dict[str, Value | Distribution]:
    given = recipe.get("parameters", {})
    if not isinstance(given, dict):
        raise RecipeError("parameters: give names of properties and their values")
    limits = property_limits(simulator)
    parameters: dict[str, Value | Distribution] = {}
    for name, value in given.items():
        where = f"parameters: {name}"
        if name not in limits:
            raise RecipeError(f"{where}: {simulator.split()[0]} has no such property")
        if not trust and not is_safe_property(simulator.split()[0], name):
            raise RecipeError(f"{where}: may name a file or an address; if you trust the recipe, run it with --trust")
        if re.search(rf"(?<!\S){re.escape(name)}=", simulator):
            raise RecipeError(f"{where}: is also set by simulator")
        if isinstance(value, dict):
            parameters[name] = _distribution(where, value, limits[name])
        elif isinstance(value, (int, float, str, bool)):
            if _is_number(limits[name]) or not isinstance(value, (bool, str)):
                _expect_number(where, value, *limits[name])
            parameters[name] = value
        else:
            raise RecipeError(f"{where}: {reprlib.repr(value)} is neither a value nor a distribution")
    for name, value in parameters.items():
        other = parameters.get(value.relative_to, "") if isinstance(value, Distribution) and value.relative_to else 1
        if isinstance(other, (str, bool)) or getattr(other, "relative_to", None) or (
                isinstance(other, Distribution) and other.kind == "choice" and
                any(isinstance(one, (str, bool)) for one in other.values)):
            raise RecipeError(f"parameters: {name}: relative-to needs a parameter that is a number and not relative")
    return parameters


def _is_number(limits: tuple[float, float]) -> bool:
    """Whether a property with these limits is a number."""
    return math.isfinite(limits[0])


def _distribution(where: str, given: Mapping[Any, Any], limits: tuple[float, float]) -> Distribution:
    _expect_keys(f"{where}: ", given, set(DISTRIBUTIONS) | {"relative-to"})
    kinds = [key for key in given if key in DISTRIBUTIONS]
    if len(kinds) != 1:
        raise RecipeError(f"{where}: give one of {', '.join(DISTRIBUTIONS)}")
    kind, values = kinds[0], given[kinds[0]]
    relative_to = given.get("relative-to")
    needs = RecipeError(f"{where}: {kind} needs {DISTRIBUTIONS[kind]}, not {reprlib.repr(values)}")
    if not isinstance(values, list) or not values or not all(isinstance(one, (int, float, str)) for one in values):
        raise needs
    if len(values) > MAX_CHOICES:
        raise RecipeError(f"{where}: more than {MAX_CHOICES} values")
    numbers = [one for one in values if isinstance(one, (int, float)) and not isinstance(one, bool)]
    if not all(map(math.isfinite, numbers)):
        raise needs
    if kind != "choice" and (len(numbers) != 2 or len(values) != 2):
        raise needs
    if kind in ("uniform", "log-uniform") and numbers[0] > numbers[1]:
        raise needs
    if (kind == "log-uniform" and numbers[0] <= 0) or (kind == "normal" and numbers[1] < 0):
        raise needs
    if relative_to is None and _is_number(limits) and len(numbers) != len(values):
        raise RecipeError(f"{where}: {reprlib.repr(values)} are not all numbers from {limits[0]:g} to {limits[1]:g}")
    if relative_to is not None and (not isinstance(relative_to, str) or len(numbers) != len(values)):
        raise RecipeError(f"{where}: relative-to needs the name of a parameter, and numbers to multiply it with")
    bounded = numbers[:1] if kind == "normal" else numbers
    if relative_to is None and not all(limits[0] <= number <= limits[1] for number in bounded):
        raise RecipeError(f"{where}: {values} is not within the property's {limits[0]:g} to {limits[1]:g}")
    return Distribution(kind, tuple(values), relative_to)


def _split(recipe: Mapping[str, Any]) -> dict[str, float]:
    given = recipe.get("split", {})
    if not isinstance(given, dict):
        raise RecipeError("split: give parts and their shares, such as {train: 0.8, validation: 0.1, test: 0.1}")
    for part, share in given.items():
        if not isinstance(part, str) or not re.fullmatch(r"[A-Za-z0-9_-]+", part):
            raise RecipeError(f"split: {part!r} is no name of letters, digits, - and _")
        _expect_number(f"split: {part}", share, 0, 1)
    if given and abs(sum(given.values()) - 1) > 1e-6:
        raise RecipeError(f"split: the shares add up to {sum(given.values()):g}, not 1")
    return given


def _check_elements(recipe: Recipe) -> None:
    """Raises RecipeError unless all elements and properties exist, and values can be parsed."""
    drawn = recipe.drawn("")
    lines = [recipe.line(drawn)] + [recipe.line({**drawn, name: value}) for name, given in recipe.parameters.items()
                                    if isinstance(given, Distribution) and given.kind == "choice"
                                    for value in given.values]
    if recipe.tensors:
        lines.append(f"eventtensor {recipe.tensors}")
    try:
        for line in lines:
            expect_limits(line)
            Pipeline(f"fakesrc ! {line} ! fakesink")
    except PipelineError as error:
        raise RecipeError(str(error)) from None
