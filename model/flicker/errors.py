"""The one error type that reaches the user."""


class FlickerError(Exception):
    """Bad input or an impossible request.

    The message is one line that names the file and the field. The command line prints it
    and exits with code 2; library users can catch it.
    """
