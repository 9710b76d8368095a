# The run, which all rules ask: what they read and make, and where everything lies.
from lightfield.workflow.handlers import Handlers
from lightfield.workflow.job_requests import JobRequests
from lightfield.workflow.run import Marks, Run
from lightfield.workflow.stored_plan import plan_of

# The configuration, the datasets and the machine.
RUN = Run.load(
    CONFIG,
    config,
    FOLDER,
    lambda: workflow.cores,
    IS_MAIN_PROCESS,
    Marks(ancient, local, unpack, update),
)
# Which jobs run, and what they read.
PLAN = plan_of(RUN)
REQUESTS = JobRequests(RUN)
# What the terminal shows.
HANDLERS = Handlers(PLAN)


wildcard_constraints:
    **RUN.constraints,
