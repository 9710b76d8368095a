"""The one exception that the programs show to the user without a traceback."""


class UserError(Exception):
    """Something the user can mend; the message says what is wrong, where, and what is right."""
