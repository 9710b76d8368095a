# Why jobs failed, for the end of a run.
import signal

# What the executor said of a job or group that failed.
SAID = {}
# Where a run ends early, and no job has failed.
UNFINISHED = "error: the run was stopped before its last job: snakemake again goes on"


def announce_stop():
    """Have a run say what SIGTERM does: Snakemake is quiet while it waits for its jobs."""
    stop = signal.getsignal(signal.SIGTERM)

    def stop_and_say_so(*arguments):
        # print() may not be called again while it prints.
        os.write(2, b"stopping after SIGTERM: the jobs that run are finished first\n")
        stop(*arguments)

    signal.signal(signal.SIGTERM, stop_and_say_so)


def note_failures():
    """Note what the executor says of jobs that fail, such as that they were refused."""
    hear_executor(SAID.__setitem__)


def full_cause(log):
    """Return why a job failed by its log, or by the disk that took no more of the log."""
    why = cause(log)
    return why if why and why.startswith("error: ") else obstacle(log) or why


def failed_jobs(failed):
    """Return rule, cause and log of each of these jobs; of a group's, of those that said why.

    Of a job that said nothing, as one that never began, it is the batch system's log, if there is,
    or else what the executor said.
    """
    found = []
    # Clocks of nodes differ.
    start = start_of_run() - 5
    for one in failed:
        jobs = own_jobs([one])
        if one.is_group():
            jobs = [
                job
                for job in own_jobs(one.jobs)
                if not all(map(os.path.exists, job.output))
            ]
        logs = [(job.rule.name, Path(job.log[0])) for job in jobs]
        for _, log in logs if STORE else ():
            name = os.path.relpath(log, stored(WORK))
            ViewStore(STORE).bring(f"{WORK}/{name}")
        spoke = [
            (name, full_cause(log), log) for name, log in logs if is_newer(log, start)
        ]
        spoke = [(name, why, log) for name, why, log in spoke if why]
        if logs and not spoke:
            name, log = min(logs)
            batch = batch_log(one.name, start)
            why = batch and cause(batch) or first_sentence(SAID.get(one) or "")
            # Where no log can be written, nothing can be said in one.
            why = why or obstacle(log) or "it said nothing"
            spoke = [(name, why, batch or log)]
        found += spoke
    return sorted(found)
