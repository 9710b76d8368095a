# Functions for the rules of validate.smk.


def validated_frames(wildcards):
    """Return what exports of a sequence are compared with: the views of all frames.

    Views of other rigs may test what these train. Their lightfield.json has their poses.
    """
    files = []
    for dataset in frames_of(wildcards):
        files += [*dataset.all_records, *dataset.lightfields]
        for export in dataset.exports.selected.values():
            if export.is_of_sequence:
                for each in testing(dataset, export):
                    files += each.lightfields
    return list(dict.fromkeys(files))


def sequence_exports(wildcards):
    """Return the lists of the exports of a sequence."""
    return frames_of(wildcards)[0].sequence_exports


def sequence_validation_settings(wildcards):
    """Return the settings file of the validation of a sequence's exports."""
    settings = SequenceValidationSettings(
        frames=[Path(dataset.paths.folder).name for dataset in frames_of(wildcards)],
        exports=sequence_exports(wildcards),
    )
    folder = f"{WORK}/{wildcards.scene}/{wildcards.rig}/settings"
    return settings_file(f"{folder}/validate.json", settings.as_json())


def verified_folders():
    """Return the folders of the chosen datasets, of sequences with exports, and of families.

    With a store, only those of finished datasets: no list has the checksums of the others' files.
    """
    if STORE:
        return [paths.folder for paths in finished_in_store()]
    folders = []
    for dataset in CHOSEN:
        folders.append(dataset.paths.folder)
        if dataset.sequence_exports:
            folders.append(dataset.sequence_paths.folder)
    return list(dict.fromkeys([*folders, *family_results()]))


def verify_command(wildcards):
    """Return the command that verifies folders. Without any, it does nothing."""
    folders = shlex.join(verified_folders())
    # The ledger does not know what other machines made.
    work = "" if STORE else f"--work {WORK}"
    return f"python {SCRIPTS}/verify.py {folders} {work}" if folders else ":"
