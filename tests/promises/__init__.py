"""What a user was promised, and the tests that hold it. They know no file that keeps track of work.

| promise | tests |
| --- | --- |
| A build is valid, and a second run does nothing. | test_workflow |
| After a kill at any moment, one run goes on, and repeats nothing. | test_kills, test_workflow |
| A change reruns what depends on it, and no more. | test_every_rule, test_provenance |
| A fresh clone beside old results has nothing to do. | test_provenance |
| A plan or verify finds every fault, and a run mends it. | test_damage, test_verify |
| A second run of a dataset is refused. Other datasets do not wait. | test_two_runs |
| Commands that show something change nothing. | test_two_runs, test_commands |
| After a kill of Snakemake alone, the next run waits for the jobs that live on. | test_two_runs |
| A full disk is named, and the old file is kept. | test_full_disk, test_failing_jobs |
| A failing job is named with its cause and its log, on clusters too. | test_failing_jobs |
| `--until`, `--forcerun` and a target by its path do what they say. | test_commands |
| A copy of a dataset is checked without the folder of work. | test_verify |
| Folders behind links keep each view, and nothing outside is moved. | test_links, test_verify |
| A user's own folder, and a module of another workflow, work. | test_own_folder, test_catalog |
| A build on Slurm loses no view by accidents. | test_slurm |
| Jobs that share no folder lose no view with a storage. | test_storage |
| A member of a family fails alone, and runs make the rest. | test_families |
| Limits, kills and damage in turn lose nothing. | test_soak |

`python benchmarks/scale.py` measures plans of 100,000 views and of 10,000 members. No test does.
"""
