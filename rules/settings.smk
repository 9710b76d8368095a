# Settings as files of a storage. Without one, the check writes them.
from lightfield.core.files import write_text


# Settings reach other machines as an output.
rule write_settings:
    input:
        mark_of_settings,
    output:
        "{path}",
    log:
        log_of("{path}"),
    wildcard_constraints:
        path=rf"{re.escape(WORK)}/(.+/)?settings/.+\.json" if STORE else one_of([]),
    localrule: True
    params:
        text=lambda wildcards: STORED_SETTINGS[wildcards.path],
    message:
        "Storing {output}"
    run:
        write_text(output[0], params.text)
