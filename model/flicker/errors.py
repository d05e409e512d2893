"""What reaches the user: the one error type, the one warning type."""

import warnings


class FlickerError(Exception):
    """Bad input or an impossible request.

    The message is one line that names the file and the field. The command line prints it
    and exits with code 2; library users can catch it.
    """


class Interrupted(KeyboardInterrupt):
    """Ctrl-C where something is kept: the message says what, and how to go on."""


class FlickerWarning(UserWarning):
    """Input that is used, though not as its name says or not all of it. The message is one line that names the file."""


def say(path: object, note: str) -> None:
    """A FlickerWarning of a file."""
    warnings.warn(FlickerWarning(f"{path}: {note}"), stacklevel=3)


def one_line(text: object) -> str:
    """An exception's or anyone's text as one printable line of at most 120 characters; the type's name for no text."""
    line = " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())
    return line[:120] or type(text).__name__
