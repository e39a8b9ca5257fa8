"""A job of 40 stations and 200 photographs, from images to results: time and memory, what a second run costs, what one station more costs.

  job.py CROSSTIE BENCH_LOAD [STATIONS PHOTOGRAPHS ...]    (default 5 25 40 200: the growth from a small job to the large one)

The twin photographs its machine (some minutes for the large one). Ends with 1 where a step fails, where a second run computes
anything anew, or where memory grows faster than the work.
"""
import os
import subprocess
import sys
import tempfile
import time


def run(*words):
    """What it printed, seconds, processor seconds and peak memory [MB] of a program."""
    begin = time.time()
    child = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    text = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    code = os.waitstatus_to_exitcode(status)
    return code, text, time.time() - begin, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main():
    crosstie, bench = sys.argv[1:3]
    sizes = [int(word) for word in sys.argv[3:]] or [5, 25, 40, 200]
    bad, before = [], None
    for stations, photographs in zip(sizes[::2], sizes[1::2]):
        with tempfile.TemporaryDirectory() as folder:
            job = os.path.join(folder, "job")
            subprocess.run([bench, "job", job, str(stations), str(photographs)], check=True)
            code, text, wall, cpu, memory = run(crosstie, "run", job)
            print(f"{stations} stations, {photographs} photographs: {wall:.1f} s, {cpu:.1f} s of processor, {memory:.0f} MB at most", flush=True)
            print("".join(f"    {line}\n" for line in text.splitlines() if not line.startswith("wa")), end="")
            if code not in (0, 1):  # 1: a verdict of the measurement
                bad.append(f"run ended with {code}: {text[-500:]}")
                continue
            again, text, wall, again_cpu, _ = run(crosstie, "run", job)
            print(f"    again: {wall:.1f} s, {again_cpu:.1f} s of processor")
            if again != code or again_cpu > 0.2 * cpu:
                bad.append(f"a second run took {again_cpu:.1f} s of processor after {cpu:.1f} s")
            work = stations + photographs
            if before and memory / before[1] > work / before[0]:
                bad.append(f"memory grew from {before[1]:.0f} to {memory:.0f} MB, faster than the work")
            before = (work, memory)
    for text in bad:
        print(f"TROUBLE: {text}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
