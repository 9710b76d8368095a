# What the shell of each job does before its program.
from lightfield.workflow.arguments import shell_prefix

shell.prefix(shell_prefix(PLAN))
