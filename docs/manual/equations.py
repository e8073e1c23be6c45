"""Equations of the pages, written in lines of Unicode, as MathML that every browser sets without help.

    (T7)  δθ = d × δe/l + d δψ

is a numbered equation; two spaces part its members.  Within one:

    x_i, x_{i+1}, x², x′, v̇    subscript, superscript, prime, dots
    a/b                         a fraction of what stands beside the stroke without a space; ( ) around a side goes
    words, `code`               stay as they are

Nothing is fetched when a page is read, and the same lines can be read as they are in an editor or on a code host.
"""

from __future__ import annotations

import re
import unicodedata
from html import escape

NUMBERED = re.compile(r"^\(((?:T|C)\d+[a-z]?)\)  (.+)$", re.MULTILINE)
CITED = re.compile(r"(?<!\[)\(((?:T|C)\d+[a-z]?)\)")
# In prose: a symbol of one or two letters with a subscript of one or two, a braced one, or the name of a work.
INLINE = re.compile(
    r"(?<![\w`.])(?<!\w\w/)([^\W\d_]{1,2}[\u0300-\u036f′]*|\])_(\{[^}\n]+\}|(?:scheme|rod)\b|[A-Za-z0-9⊥∞]{1,2}(?!\w))"
)
FENCE = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
POWER = re.compile(r"\^(?:\(([^()\n]+)\)|(-?[A-Za-z0-9.]+)(?<!\.))")
CODE = re.compile(r"`[^`\n]*`|\]\([^)\n]*\)")  # and where links lead

FUNCTIONS = {"cos", "sin", "cot", "cosh", "sinh", "tanh", "sqrt", "exp", "max", "min", "diag"}
SYMBOLS = {"EI", "EA", "GJ", "kb", "kd", "vp", "dp", "ds"}  # of two letters
RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ᵀ", "0123456789+−T", strict=True))
LOWERED = dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789", strict=True))
DOTS = {"\u0307": "˙", "\u0308": "¨"}
THIN = '<mspace width="0.12em"/>'
BRACKETS = {"(": ")", "[": "]", "|": "|"}
TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<code>`[^`]*`)|(?P<number>\d+(?:\.\d+)?)|(?P<word>[A-Za-z]{2,})"
    r"|(?P<mark>[½⁰¹²³⁴-⁹⁺⁻ᵀ₀-₉′Σ∂∫])|(?P<letter>[^\W\d_][\u0300-\u036f]*)|(?P<sub>_(?:\{[^}]*\}|[^\W_]+|[⊥×∞]))|(?P<other>.)"
)


def equation(number: str, text: str) -> str:
    """A numbered equation as a block of HTML."""
    members = "".join(f'<math displaystyle="true">{math(part)}</math>' for part in re.split(r" {2,}", text.strip()))
    return f'<div class="equation" id="{number}"><div>{members}</div><span>({number})</span></div>'


def math(text: str) -> str:
    """One member as the content of a math element."""
    return _Row(text).all()


def page(text: str, home: str) -> str:
    """A page with its equations set, cited numbers as links to them on the page `home`, and subscripts in its prose."""
    kept: list[str] = []

    def keep(html: str) -> str:
        kept.append(html)
        return f"\x02{len(kept) - 1}\x03"

    text = FENCE.sub(lambda m: keep(m[0]), text)
    text = NUMBERED.sub(lambda m: "\n" + keep(equation(m[1], m[2])) + "\n", text)
    text = CODE.sub(lambda m: keep(m[0]), text)
    text = CITED.sub(lambda m: f"[({m[1]})]({home}#{m[1]})", text)
    text = INLINE.sub(lambda m: f"{m[1]}<sub>{m[2].strip('{}')}</sub>", text)
    text = POWER.sub(lambda m: f"<sup>{m[1] or m[2]}</sup>", text)
    return re.sub("\x02(\\d+)\x03", lambda m: kept[int(m[1])], text)


class _Row:
    """Reads one member from left to right."""

    def __init__(self, text: str) -> None:
        text = unicodedata.normalize("NFD", text).replace("]×", "]_×")
        self._tokens = [(m.lastgroup or "", m[0]) for m in TOKEN.finditer(text)]
        self._at = 0

    def all(self) -> str:
        return self._until("")

    def _peek(self) -> tuple[str, str]:
        return self._tokens[self._at] if self._at < len(self._tokens) else ("end", "")

    def _take(self) -> tuple[str, str]:
        token = self._peek()
        self._at += 1
        return token

    def _until(self, closing: str) -> str:
        """Items up to a closing bracket, which is left; runs without a space may be sides of a fraction."""
        out: list[str] = []
        run: list[str] = []
        bare = ""  # the content of the run, where it is one pair of parentheses
        while (token := self._peek())[0] != "end" and token[1] != closing:
            kind, text = token
            if kind == "space":
                self._take()
                thin = [THIN] if run and not self._operator(self._peek()[1]) else []
                out, run, bare = [*out, *run, *thin], [], ""
            elif text == "/" and run:
                self._take()
                below = self._side()
                run, bare = [f"<mfrac>{_row(bare or ''.join(run))}{_row(below)}</mfrac>"], ""
            elif self._operator(text):
                self._take()
                out, run, bare = [*out, *run, f"<mo>{escape(text)}</mo>"], [], ""
            else:
                item, inside = self._item()
                bare = inside if not run else ""
                run.append(item)
        return "".join(out + run)

    def _side(self) -> str:
        """What stands below a stroke: all up to a space or an operator."""
        out: list[str] = []
        bare = ""
        while (token := self._peek())[0] not in ("end", "space") and not self._operator(token[1]):
            if token[1] in ")]|/" and not (token[1] == "|" and not out):
                break
            item, inside = self._item()
            bare = inside if not out else ""
            out.append(item)
        return bare or "".join(out)

    @staticmethod
    def _operator(text: str) -> bool:
        return text in {"=", "+", "−", "-", "×", "·", ",", ";", ":", "<", ">", "≤", "≥", "←", "."}

    def _item(self) -> tuple[str, str]:
        """A symbol or a bracket with its scripts; and the inside of plain parentheses."""
        kind, text = self._take()
        inside = ""
        if text in BRACKETS:
            inner = self._until(BRACKETS[text])
            _, end = self._take()
            fence = '<mo stretchy="{}">{}</mo>'
            grows = "true" if "<mfrac>" in inner else "false"
            base = f"<mrow>{fence.format(grows, text)}{inner}{fence.format(grows, end)}</mrow>"
            inside = inner if text == "(" else ""
        else:
            base = _symbol(kind, text)
        down, up = "", ""
        while True:
            kind, text = self._peek()
            if kind == "sub":
                down += math(text[1:].strip("{}")).replace("&nbsp;", "")
            elif text in LOWERED:
                down += f"<mn>{LOWERED[text]}</mn>"
            elif text in RAISED:
                up += f"<mo>{RAISED[text]}</mo>" if text in "⁺⁻" else f"<mi>{RAISED[text]}</mi>"
            elif text == "′":  # raised by its own shape
                base = f'<mrow>{base}<mo lspace="0" rspace="0.1em">′</mo></mrow>'
            else:
                break
            self._take()
            inside = ""
        if down and up:
            return f"<msubsup>{base}{_row(down)}{_row(up)}</msubsup>", inside
        if down:
            return f"<msub>{base}{_row(down)}</msub>", inside
        if up:
            return f"<msup>{base}{_row(up)}</msup>", inside
        return base, inside


def _row(content: str) -> str:
    return f"<mrow>{content}</mrow>"


def _symbol(kind: str, text: str) -> str:
    if kind == "number":
        return f"<mn>{text}</mn>"
    if kind == "code":
        return f"<mtext><code>{escape(text.strip('`'))}</code></mtext>"
    if kind == "word":
        if text in FUNCTIONS or text in SYMBOLS:
            return f"<mi>{text}</mi>" + ("<mspace width='0.17em'/>" if text in FUNCTIONS else "")
        return f"<mtext>&nbsp;{text}&nbsp;</mtext>"
    if kind == "letter":
        symbol = f"<mi>{text[0]}</mi>"
        for mark in text[1:]:
            symbol = f'<mover accent="true">{symbol}<mo>{DOTS.get(mark, mark)}</mo></mover>'
        return symbol
    if text == "½":
        return "<mfrac><mn>1</mn><mn>2</mn></mfrac>"
    return f"<mo>{escape(text)}</mo>"
