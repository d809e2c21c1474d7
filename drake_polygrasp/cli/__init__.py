"""The `polygrasp` command: one file a subcommand, with its options and its call.

| file | what it holds |
|---|---|
| main.py | reads the arguments, runs a subcommand, returns the exit code |
| plan.py | `polygrasp plan` |
| plan_table.py | what it prints |
| verify.py | `polygrasp verify` |
| verify_table.py | what it prints |
| explain.py | `polygrasp explain` |
| explain_table.py | what it prints |
| show.py | `polygrasp show` |
| exhibit.py | what it shows: a grasp file, or a model that is planned first |
| export.py | `polygrasp export` |
| options.py | options that several subcommands share |
| values.py | values of options, read and checked |
| table.py | lines and columns that tables share |
| reporting.py | lines on standard error, JSON, exit codes |
| calls.py | what a child process is asked, and loading the model in one |
| child_process.py | calls in a child process, bounded in time and memory |
| progress_line.py | progress on a terminal |
"""

from drake_polygrasp.cli.main import main

__all__ = ["main"]
