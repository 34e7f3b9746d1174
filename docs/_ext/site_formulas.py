"""Formulas as MathML: drawn by the browser, without a script, and read aloud by screen readers."""

from __future__ import annotations

import re
from html import unescape
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

_LOGGER = logging.getLogger(__name__)
_NAMESPACE = "http://www.w3.org/1998/Math/MathML"
_NAMED = re.compile(r"&(?!(?:amp|lt|gt|quot|apos);)[A-Za-z]\w*;")  # characters that HTML has names for, and XML not


def mathml(text: str, *, block: bool = False) -> str:
    """A formula of LaTeX; the index of a letter with a dot or a hat stands beside it, not below."""
    ElementTree.register_namespace("", _NAMESPACE)
    root = ElementTree.fromstring(_NAMED.sub(lambda found: unescape(found[0]), tex2mathml(text, as_block=block)))
    for table in root.iter(f"{{{_NAMESPACE}}}mtable"):
        table.set("displaystyle", "true")  # else fractions in lines of an alignment are small
    for element in root.iter(f"{{{_NAMESPACE}}}munderover"):
        base, index, accent = element
        if accent.get("stretchy") == "false" and not base.tag.endswith("}mo"):  # no sum with its limits
            letter = ElementTree.Element(f"{{{_NAMESPACE}}}mover", accent="true")
            letter.extend([base, accent])
            element.tag = f"{{{_NAMESPACE}}}msub"
            element[:] = [letter, index]
    return ElementTree.tostring(root, encoding="unicode")


def _inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(_told(node))
    raise nodes.SkipNode


def _block(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(f'<div class="math">{_told(node, block=True)}</div>\n')
    raise nodes.SkipNode


def _told(node: nodes.Element, *, block: bool = False) -> str:
    try:
        return mathml(node.astext(), block=block)
    except MathError as error:
        _LOGGER.warning("formula: %s", error, location=node)
        return ""


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
