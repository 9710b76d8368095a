"""Cleans the environment of the tests as programs clean theirs. Import it before numpy.

So what a test computes itself, and what it computes in a fork, has the bytes of a user's build.
"""

import os

from lightfield.core import isolation

environment = isolation.cleaned(os.environ) | isolation.own_variables()
os.environ.clear()
os.environ.update(environment)
