"""Sealed answers: committed to before the first diagnosis starts, opened after the last has ended.

A commitment is SHA-256 of a random salt and the answer as JSON. Commitments are published at once; answers
and salts stay in the memory of the process that drew them, so that no diagnosis can read them, and who drew
them cannot change them either.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rtcomp.errors import RtcompError

METHOD = "sha256 of the salt's bytes followed by the answer as JSON, keys sorted, no spaces, UTF-8"


class SealError(RtcompError):
    """An answer is not the one that was committed to, or was to be opened too early."""


class Sealed:
    """Answers by case, in memory until they are opened."""

    def __init__(
        self, answers: Mapping[str, Mapping[str, Any]], salts: Mapping[str, str] | None = None
    ) -> None:
        """Seal `answers`, with the `salts` (hexadecimal, by case) of a trial that goes on, or new ones."""
        self._answers = {name: _text(answer) for name, answer in answers.items()}
        self._salts = {
            name: bytes.fromhex(salts[name]) if salts else secrets.token_bytes(32) for name in answers
        }

    @property
    def salts(self) -> dict[str, str]:
        """The salts; whoever has them and guesses an answer can tell that it is right."""
        return {name: salt.hex() for name, salt in self._salts.items()}

    def commitments(self) -> dict[str, str]:
        """Return the commitment to each answer, which tells nothing about it."""
        return {name: _digest(self._salts[name], text) for name, text in self._answers.items()}

    def publish(self, path: Path) -> None:
        """Write the commitments; no answer can be changed from here on."""
        content = {"method": METHOD, "commitments": self.commitments()}
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    def check(self, published: Path) -> None:
        """Raise SealError where an answer is not the one that was committed to in `published`."""
        committed = _published(published)
        for name, digest in self.commitments().items():
            if committed.get(name) != digest:
                raise SealError(
                    f"{published}: {name} does not come out as it was committed to; another version of "
                    "rtcomp drew it: start the trial anew"
                )

    def open(self, path: Path, published: Path) -> dict[str, Any]:
        """Write salts and answers to `path` and return the answers, checked against what was published."""
        content = {
            name: {"salt": self._salts[name].hex(), "answer": json.loads(text)}
            for name, text in self._answers.items()
        }
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        return verify(path, published)


def verify(answers: Path, published: Path) -> dict[str, Any]:
    """Return the answers in a file that was opened; raise SealError where one is not as committed to."""
    commitments = _published(published)
    opened: dict[str, Any] = json.loads(answers.read_text(encoding="utf-8"))
    odd = sorted(set(commitments) ^ set(opened))
    if odd:
        raise SealError(f"{answers}: {odd[0]} is not in both the answers and {published.name}; drawn anew?")
    for name, entry in opened.items():
        if _digest(bytes.fromhex(entry["salt"]), _text(entry["answer"])) != commitments[name]:
            raise SealError(
                f"{answers}: the answer of {name} does not match its commitment in {published.name}; "
                "it was changed after the trial began"
            )
    return {name: entry["answer"] for name, entry in opened.items()}


def _published(path: Path) -> dict[str, str]:
    commitments: dict[str, str] = json.loads(path.read_text(encoding="utf-8"))["commitments"]
    return commitments


def _text(answer: Mapping[str, Any]) -> str:
    return json.dumps(answer, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _digest(salt: bytes, text: str) -> str:
    return hashlib.sha256(salt + text.encode("utf-8")).hexdigest()
