"""What can go wrong, as exceptions: each carries one sentence and the parts it is made of."""

from __future__ import annotations


class FtcError(Exception):
    """Base of all errors of this package; `str(error)` is one sentence."""


class DesignFileError(FtcError, ValueError):
    """What was given is at fault: the sentence names the key and what to do.

    Attributes:
        key: Key of the design file, such as `controller.decay`; `None` where no single key is at fault.
        line: Line in the design file, from 1; `None` where it was not read from text.
    """

    def __init__(self, sentence: str, key: str | None = None, line: int | None = None) -> None:
        """Keeps the sentence and its parts."""
        super().__init__(sentence)
        self.key = key
        self.line = line


class NoDesign(FtcError):
    """The request is sound, but there is no such controller, or none that can be certified.

    Attributes:
        advice: What to change, one sentence each, the most promising first.
    """

    def __init__(self, sentence: str, advice: list[str] | None = None) -> None:
        """Keeps the sentence and its parts."""
        super().__init__(sentence)
        self.advice = advice or []


class Infeasible(NoDesign):
    """No gains satisfy what was asked for.

    Attributes:
        blocks: Pairs of an inequality's name and its share in the conflict, the largest first.
        advice: What to change, one sentence each.
    """

    def __init__(
        self, sentence: str, blocks: list[tuple[str, float]] | None = None, advice: list[str] | None = None
    ) -> None:
        """Keeps the sentence and its parts."""
        super().__init__(sentence, advice)
        self.blocks = blocks or []


class Uncertified(NoDesign):
    """Gains were found, but their inequalities could not be proved with rounding accounted for."""


class Unproved(FtcError):
    """An FMU does not hold what it promises."""


class MissingExtra(FtcError, ImportError):
    """An optional package is not installed; the sentence says what to type."""


def extra(module: str, name: str | None = None) -> object:
    """Imports an optional package.

    Args:
        module: Module to import.
        name: The extra that brings it; the module's own name by default.

    Returns:
        The module.

    Raises:
        MissingExtra: Where it is not installed.
    """
    import importlib  # noqa: PLC0415  (kept beside its only use)

    try:
        return importlib.import_module(module)
    except ImportError as error:
        wanted = name or module
        raise MissingExtra(f"{wanted} is not installed: pip install 'ftc-fmu[{wanted}]'") from error
