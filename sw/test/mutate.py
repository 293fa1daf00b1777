# SPDX-License-Identifier: Apache-2.0
"""Mutants of the translation core and of the poll loop, and the host tests, for `make kills`.

A mutant is one small change in a file. It is caught if a host test or the fuzzer's corpus fails or does not
end. A mutant that compiles to the same code, or that sw/test/survivors.toml excuses, is not counted.
"""

from __future__ import annotations

import hashlib
import os
import random
import resource
import shutil
import signal
import subprocess
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
import tree_sitter_c
from _pytest.runner import runtestprotocol
from tree_sitter import Language, Node
from tree_sitter import Parser as SourceParser

from sw.test.host import BUILDS, CORE, DIALECTS, HOST, INCLUDES, ROOT, sources
from tb.model.firmware import Build

CORPUS = ROOT / "sw/test/corpus"
POLL_LOOP = ("gateway.c", "request.c", "orders.c", "exchange.c")
FILES = (*CORE, *POLL_LOOP)
SEED = "1"  # of the random tests, so that the result for a mutant is repeatable
EXCUSED = "excused"
NOT_COUNTED = ("does not compile", "same code", EXCUSED)
SURVIVORS = ROOT / "sw/test/survivors.toml"
REPLAY_S, TESTS_S = 10, 60
LIKELY = 100  # tests that are tried first
SLOW = ("random", "any_sequence", "parameters_end", "no_other_register")
# Fixtures of the tests with MASTER_LOSS_STOP, REPLY_DELAY and DIAGNOSTICS: poll loops of other builds.
FIXTURES = {"running", "delayed", "diagnosed", "diagnosed_card"}
GATEWAY_TESTS = "tb/firmware/test_firmware_gateway.py"
TESTS = ["tb/firmware/test_firmware_translate.py", "tb/firmware/test_firmware_dialects.py", GATEWAY_TESTS]

OPERATORS = {
    **{"<": "<= >=", "<=": "< >", ">": ">= <=", ">=": "> <", "==": "!=", "!=": "==", "&&": "||", "||": "&&"},
    **{"+": "-", "-": "+", "<<": ">>", ">>": "<<", "&": "|", "|": "&", "++": "--", "--": "++"},
    **{"+=": "-= =", "-=": "+=", "|=": "= &=", "&=": "= |=", ">>=": "<<=", "<<=": ">>="},
}
WORDS = {"true": "false", "false": "true"}
parser = SourceParser(Language(tree_sitter_c.language()))
CONDITIONS = ("if_statement", "while_statement", "conditional_expression")


@dataclass(frozen=True)
class Mutant:
    file: str
    line: int
    function: str
    start: int  # bytes
    end: int
    old: str
    new: str

    @property
    def change(self) -> str:
        return f"{' '.join(self.old.split())} -> {' '.join(self.new.split()) or 'nothing'}"


def nodes(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        yield from nodes(child)


def function_name(node: Node | None) -> str:
    while node and node.type != "function_definition":
        node = node.parent
    inside = nodes(node.child_by_field_name("declarator")) if node else ()
    return next((n.text.decode() for n in inside if n.type == "identifier"), "")


def changes(node: Node) -> Iterator[tuple[Node, str]]:
    """The replacements for a node or for one of its children."""
    text = node.text.decode()
    kind = node.type
    if kind in ("binary_expression", "assignment_expression", "update_expression"):
        operator = node.child_by_field_name("operator")
        for other in OPERATORS.get(operator.text.decode(), "").split():
            yield operator, other
        if operator.text in (b"&&", b"||"):
            for side in ("left", "right"):
                yield node, node.child_by_field_name(side).text.decode()
    elif kind == "unary_expression" and text[0] in "!~":
        yield node, node.child_by_field_name("argument").text.decode()
    elif kind in CONDITIONS:
        condition = node.child_by_field_name("condition")
        whole = condition.text.decode()  # of an `if` with its brackets
        yield condition, f"(!{whole})" if kind != CONDITIONS[2] else f"!({whole})"
    elif kind == "number_literal":
        suffix = text[len(text.rstrip("uU")) :]
        value = int(text.rstrip("uU"), 0)
        for other in {value + 1, max(value - 1, 0)} - {value}:
            yield node, f"{other}{suffix}"
    elif kind in ("true", "false"):
        yield node, WORDS[text]
    elif kind == "expression_statement":
        yield node, ";"
    elif kind == "identifier" and text.isupper() and len(text) > 2 and text != "TRAITS":
        if node.parent.type not in ("enumerator", "preproc_def", "subscript_designator", "declaration"):
            yield node, f"({text} + 1)"
    elif kind == "field_expression" and text.startswith("TRAITS."):
        yield node, f"({text} + 1)"


def mutants_of(name: str) -> list[Mutant]:
    source = (ROOT / "sw/src" / name).read_bytes()
    found = []
    for node in nodes(parser.parse(source).root_node):
        if node.type.startswith("preproc_") and node.type not in ("preproc_if", "preproc_ifdef"):
            continue
        if any(above.type in ("preproc_def", "array_declarator") for above in ancestors(node)):
            continue
        for place, new in changes(node):
            old = place.text.decode()
            line = place.start_point[0] + 1
            found.append(Mutant(name, line, function_name(place), place.start_byte, place.end_byte, old, new))
    return sorted(set(found), key=lambda mutant: (mutant.start, mutant.end, mutant.new))


def ancestors(node: Node) -> Iterator[Node]:
    while node := node.parent:
        yield node


def chosen_mutants(count: int) -> list[Mutant]:
    """The same `count` mutants of each file every time; 0: all."""
    chosen = []
    for name in FILES:
        mutants = mutants_of(name)
        if 0 < count < len(mutants):
            mutants = random.Random(f"{SEED} {name}").sample(mutants, count)
        chosen += mutants
    return chosen


# ---------------------------------------------------------------- survivors with a reason


@cache
def functions_of(source: bytes) -> list[tuple[int, int, str]]:
    """Begin, end and hash of the text of each function or table."""
    nodes_there = parser.parse(source).root_node.children
    return [(n.start_byte, n.end_byte, hashlib.sha256(n.text).hexdigest()[:8]) for n in nodes_there]


def around(mutant: Mutant) -> tuple[int, str]:
    """The mutant's place in its function or table, and the hash of that."""
    of = functions_of((ROOT / "sw/src" / mutant.file).read_bytes())
    return next((mutant.start - begin, text) for begin, end, text in of if begin <= mutant.start < end)


@cache
def excuses() -> dict[tuple, str]:
    rows = tomllib.loads(SURVIVORS.read_text())["mutant"]
    return {(row["file"], row["at"], row["of"], row["change"]): row["why"] for row in rows}


def is_excused(mutant: Mutant) -> bool:
    return (mutant.file, *around(mutant), mutant.change) in excuses()


def outdated() -> list[str]:
    """Rows that excuse no mutant of the present sources."""
    rows = {(mutant.file, *around(mutant), mutant.change) for mutant in chosen_mutants(0)}
    return [
        f"survivors.toml: {file}: `{change}`: the function has changed; try the mutant again"
        for file, at, of, change in excuses()
        if (file, at, of, change) not in rows
    ]


# ---------------------------------------------------------------- one mutant's builds


class MutantBuild:
    """A copy of the sources with at most one mutant, and its builds."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.mutant: Mutant | None = None
        self.compiled: set[str] = set()  # builds
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(ROOT / "sw", folder / "sw", ignore=shutil.ignore_patterns("corpus"))
        shutil.copytree(ROOT / "regs/generated", folder / "regs/generated")
        self.files = [*sources(), *HOST]
        self.replayed = [*self.files, *(f"sw/test/{name}.c" for name in ("fuzz", "replay", "fuzz_gateway"))]
        for build in BUILDS:
            for file in self.replayed if build in DIALECTS else self.files:
                self._compile(file, build)
        self.same: dict[tuple[str, str], bytes] = {}

    def _object(self, file: str, build: str, changed: bool = False) -> Path:
        folder = self.folder / ("changed" if changed else "plain") / build
        folder.mkdir(parents=True, exist_ok=True)
        return folder / (Path(file).stem + ".o")

    def _run(self, *command: str | Path) -> bool:
        done = subprocess.run(list(map(str, command)), cwd=self.folder, capture_output=True, check=False)
        return done.returncode == 0

    def _compile(self, file: str, build: str, *more: str, changed: bool = False) -> bool:
        flags = ["-std=c99", "-w", "-O0", "-fPIC", *INCLUDES, "-Isw/test", *BUILDS[build], *more]
        return self._run("gcc", *flags, "-c", file, "-o", self._object(file, build, changed))

    def touched(self) -> list[str]:
        """The sources to compile again; of a header all sources, for any may include it."""
        if self.mutant is None:
            return []
        name = self.mutant.file
        if name.endswith(".c"):
            return [f"sw/src/{name}"]
        return [file for file in self.files if file not in HOST]

    def change(self, mutant: Mutant | None) -> None:
        """Restores the file of the last mutant and writes this one."""
        if self.mutant:
            shutil.copy(ROOT / "sw/src" / self.mutant.file, self.folder / "sw/src" / self.mutant.file)
        self.mutant, self.compiled = mutant, set()
        # If the mutant does not compile in a build, that build must not link an earlier one.
        shutil.rmtree(self.folder / "changed", ignore_errors=True)
        if mutant:
            source = (ROOT / "sw/src" / mutant.file).read_bytes()
            changed = source[: mutant.start] + mutant.new.encode() + source[mutant.end :]
            (self.folder / "sw/src" / mutant.file).write_bytes(changed)

    def make(self, build: str) -> bool:
        if build not in self.compiled:
            self.compiled.add(build)
            return all(self._compile(file, build, changed=True) for file in self.touched())
        return True

    def _objects(self, files: list[str], build: str) -> list[Path]:
        touched = self.touched()
        return [self._object(file, build, file in touched) for file in files]

    def link_replayer(self, dialect: str) -> Path:
        self.make(dialect)
        target = self.folder / dialect / "replay"
        target.parent.mkdir(exist_ok=True)
        self._run("gcc", "-o", target, *self._objects(self.replayed, dialect))
        return target

    def link_libraries(self) -> None:
        for build in BUILDS:
            self.make(build)
            target = self.folder / build / "libtranslate.so"
            target.parent.mkdir(exist_ok=True)
            target.unlink(missing_ok=True)
            self._run("gcc", "-shared", "-o", target, *self._objects(self.files, build))

    def _machine_code(self, file: str, build: str) -> bytes:
        self._compile(file, build, "-O2", "-g0", changed=True)
        return self._object(file, build, changed=True).read_bytes()

    def same_code(self) -> bool:
        """True if the mutant compiles to the same code in every build. Removes the mutant."""
        mutant, touched = self.mutant, self.touched()
        changed = {(file, build): self._machine_code(file, build) for build in BUILDS for file in touched}
        self.change(None)
        for place in changed.keys() - self.same.keys():
            self.same[place] = self._machine_code(*place)
        self.mutant = mutant
        return all(self.same[place] == code for place, code in changed.items())


def replay_fails(make_replayer: Callable[[str], Path]) -> str:
    inputs = sorted(CORPUS.iterdir())
    for dialect in DIALECTS:
        try:
            command = [make_replayer(dialect), *inputs]
            done = subprocess.run(command, capture_output=True, timeout=REPLAY_S, check=False)
        except subprocess.TimeoutExpired:
            return "never ends"
        if done.returncode:
            return "corpus"
    return ""


# ---------------------------------------------------------------- the tests, collected once


class HostTests:
    """A plugin of pytest: collects the tests, which then run in a child process for each mutant."""

    def __init__(self, builds: MutantBuild) -> None:
        self.builds = builds

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Sorts the host tests: those of the poll loop (True), and of the core, the slow ones last."""
        items.sort(key=lambda item: any(word in item.name for word in SLOW))
        self.items = {
            True: [item for item in items if of_gateway(item)],
            False: [item for item in items if item.path != ROOT / GATEWAY_TESTS and of_core(item)],
        }

    def fate(self, mutant: Mutant, items: list[pytest.Item]) -> str:
        self.builds.change(mutant)
        if not self.builds.make("card"):
            return "does not compile"
        self.builds.link_libraries()
        if fate := self.tests_fail(items[:LIKELY]):
            return fate
        # Compare the code first: with the same code all remaining tests would run in vain.
        if self.builds.same_code():
            return "same code"
        self.builds.change(mutant)
        self.builds.link_libraries()
        if fate := self.tests_fail(items[LIKELY:]):
            return fate
        # In a child of their own: TESTS_S is for the tests of one kind.
        if mutant.file not in POLL_LOOP and (fate := self.tests_fail(self.items[True])):
            return fate
        return EXCUSED if is_excused(mutant) else "survives"

    def tests_fail(self, items: list[pytest.Item]) -> str:
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            with open(os.devnull, "w") as nothing:
                os.dup2(nothing.fileno(), 1)
                os.dup2(nothing.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_CPU, (TESTS_S, TESTS_S))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            for item in items:
                if any(report.failed for report in runtestprotocol(item, log=False, nextitem=None)):
                    os.write(write, item.name.encode()[:200])
                    break
            os._exit(0)
        os.close(write)
        with open(read, "rb") as pipe:
            failed = pipe.read().decode()
        status = os.waitpid(child, 0)[1]
        if os.WIFSIGNALED(status):
            return "never ends" if os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL) else "crashes"
        return f"test {failed}" if failed else ""


def parameters(item: pytest.Item) -> dict[str, object]:
    return item.callspec.params if hasattr(item, "callspec") else {}


def of_core(item: pytest.Item) -> bool:
    given = parameters(item)
    is_option = "option" in given and "random" not in item.name
    return not (of_gateway(item) or is_option or any(isinstance(value, Build) for value in given.values()))


def of_gateway(item: pytest.Item) -> bool:
    """Tests of the poll loop in the host libraries. An image has no mutant."""
    if FIXTURES & set(item.fixturenames) or item.name.startswith("test_after"):
        return True
    return any(isinstance(value, Build) and not value.on_card for value in parameters(item).values())
