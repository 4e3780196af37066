# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's own error messages, as its source has them, and those that docs/errors.md leaves out.

    messages.py        every message, with the file and line that raises it
"""

import ast
import re

from parts import ROOT, say

ADDON = ROOT / "addon" / "matterfit"
LISTED = ROOT / "docs" / "errors.md"
OPENING = 6  # words by which a message is looked for


def template(node):
    """The text of an expression with `…` for each value; None where the source does not hold it."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return re.sub(r"\{[^{}]*\}", "…", node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        parts = [template(side) for side in (node.left, node.right)]
        return None if parts == [None, None] else "".join(part or "…" for part in parts)
    if isinstance(node, ast.Call):
        # translate("…"), and "…".format(…) of either
        inner = node.func.value if isinstance(node.func, ast.Attribute) else None
        if inner is not None and node.func.attr == "format":
            return template(inner)
        if getattr(node.func, "id", "") == "translate":
            return template(node.args[0])
    return None


def messages():
    """[(file, line, text)] of every JobError in addon/ whose text stands there."""
    found = []
    for file in sorted(ADDON.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and node.args and (
                getattr(node.func, "id", "") == "JobError" or getattr(node.func, "attr", "") == "JobError"
            ):
                text = template(node.args[0])
                if text is not None and text.strip("… "):
                    found.append((file.relative_to(ROOT), node.lineno, text))
    return found


def opening(text):
    """The first words, at most the first sentence: what comes after may be the advice."""
    sentence = re.split(r"(?<=[.?])\s", text, maxsplit=1)[0]
    return " ".join(sentence.split()[:OPENING])


def unlisted():
    """The messages whose opening words are not in docs/errors.md."""
    listed = " ".join(LISTED.read_text(encoding="utf-8").split())
    return [found for found in messages() if opening(found[2]) not in listed]


if __name__ == "__main__":
    for file, line, text in messages():
        say(f"{file}:{line}: {text}")
