"""Costs of programs that take turns, and ratios of these costs with confidence intervals."""
import math
import os

# Two-sided 95 % quantiles of Student's t, by degrees of freedom.
_T95 = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131)


class Failed(Exception):
    """A program that did not end well; the text says which and how."""


class Cost:
    """CPU seconds of a program and of all that it waited for, and the peak memory of its largest process."""

    def __init__(self, cpu_s, peak_mib):
        self.cpu_s = cpu_s
        self.peak_mib = peak_mib


def cost_of(command, log):
    """Runs a command; its output is appended to the file `log`. Raises Failed for an exit code other than 0."""
    out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        pid = os.posix_spawnp(command[0], command, os.environ,
                              file_actions=[(os.POSIX_SPAWN_DUP2, out, 1), (os.POSIX_SPAWN_DUP2, out, 2)])
    except OSError as error:
        raise Failed("%s: %s" % (command[0], error.strerror)) from None
    finally:
        os.close(out)
    _, status, usage = os.wait4(pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code != 0:
        raise Failed("%s: exit code %d, output in %s" % (" ".join(command), code, log))
    return Cost(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def in_turns(runs, rounds):
    """Calls every function of `runs` once a round, in turned order every second round, so that a machine that
    gets slower is unfair to nobody. Returns what each gave, by run."""
    results = [[] for _ in runs]
    for k in range(rounds):
        order = range(len(runs)) if k % 2 == 0 else reversed(range(len(runs)))
        for i in order:
            results[i].append(runs[i]())
    return results


def ratio_interval(over, under):
    """Geometric mean of over[k] / under[k] and its 95 % confidence interval: (mean, low, high). One pair has no
    interval: low is 0 and high infinite."""
    tiny = 1e-6  # s: what no clock tells from 0
    logs = [math.log(max(a, tiny) / max(b, tiny)) for a, b in zip(over, under)]
    n = len(logs)
    mean = sum(logs) / n
    if n < 2:
        return math.exp(mean), 0.0, math.inf
    variance = sum((x - mean) ** 2 for x in logs) / (n - 1)
    half = (_T95[n - 2] if n - 2 < len(_T95) else 1.96) * math.sqrt(variance / n)
    return math.exp(mean), math.exp(mean - half), math.exp(mean + half)
