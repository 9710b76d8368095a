# Settings as files of a storage. Without one, the plan writes them.
from lightfield.core.files import write_text


# Settings reach other machines as an output.
rule write_settings:
    input:
        PLAN.mark_of_settings,
    output:
        "{path}",
    log:
        RUN.log_of("{path}"),
    wildcard_constraints:
        path=PLAN.settings_paths,
    localrule: True
    params:
        text=lambda wildcards: PLAN.settings_texts[wildcards.path],
    message:
        "Storing {output}"
    run:
        write_text(output[0], params.text)
