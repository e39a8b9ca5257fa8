"""The operator's page for an hour: browsers that watch, one that hardly reads, one that comes and goes, and an operator.

  page.py CROSSTIE [MINUTES] [SCENE]     (default 60 minutes, scene segment)

Starts `CROSSTIE live --twin SCENE` in a temporary folder, reads its memory from /proc every two seconds and prints a line a minute.
Ends with 1 where memory grows, a stream tears, states run backwards or the cameras lose pairs. The operator takes the board, the
cross and the wall one after the other and computes their results; then he repeats the last station again and again.
"""
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

WATCHERS = 2  # each reads the states and both cameras; the program admits 12 streams
GROWTH_LIMIT_MB_PER_HOUR = 16.0
SETTLED_SHARE = 0.5  # of the time, at the end, and only what comes after all results are there
SHORTEST_S = 600.0  # that tells growth


class Counters:
    def __init__(self):
        self.lock = threading.Lock()
        self.states = self.pictures = self.visits = self.taken = self.reconnected = 0
        self.troubles = []

    def add(self, name, count=1):
        with self.lock:
            setattr(self, name, getattr(self, name) + count)

    def trouble(self, text):
        with self.lock:
            if len(self.troubles) < 50:
                self.troubles.append(text)


class Page:
    def __init__(self, url, counters):
        found = re.fullmatch(r"http://([^:]+):(\d+)/#(\w+)", url)
        self.host, self.port, self.token = found[1], int(found[2]), found[3]
        self.counters = counters
        self.ended = threading.Event()

    def request(self, path, method="GET", body=None, headers=None):
        connection = http.client.HTTPConnection(self.host, self.port, timeout=60)
        connection.request(method, path, body, headers or {})
        return connection, connection.getresponse()

    def json(self, path):
        connection, answer = self.request(path)
        text = answer.read()
        connection.close()
        return json.loads(text) if answer.status == 200 else None

    def command(self, **words):
        connection, answer = self.request("/command", "POST", json.dumps(words),
                                          {"X-Crosstie-Token": self.token, "Content-Type": "application/json"})
        text = answer.read().decode()
        connection.close()
        return answer.status, text

    def watch_states(self):
        last = -1
        _, answer = self.request("/events")
        while not self.ended.is_set():
            line = answer.readline()
            if not line:
                break
            if line.startswith(b"id:"):
                version = int(line[3:])
                if version <= last:
                    self.counters.trouble(f"state {version} after {last}")
                last = version
            elif line.startswith(b"data:"):
                json.loads(line[5:])
                self.counters.add("states")
        if not self.ended.is_set():
            self.counters.trouble("the states ended")

    def watch_camera(self, side, parts=None):
        _, answer = self.request(f"/camera/{side}")
        while not self.ended.is_set() and parts != 0:
            length = None
            while (line := answer.readline()) not in (b"\r\n", b""):
                if line.lower().startswith(b"content-length:"):
                    length = int(line.split(b":")[1])
            if line == b"":
                break
            if length is None:
                continue  # the line end behind a picture
            picture = answer.read(length)
            if picture[:2] != b"\xff\xd8" or picture[-2:] != b"\xff\xd9":
                self.counters.trouble(f"a torn picture of camera {side}")
            self.counters.add("pictures")
            parts = None if parts is None else parts - 1
        if not self.ended.is_set() and parts != 0:
            self.counters.trouble(f"the pictures of camera {side} ended")
        answer.close()

    def hardly_read(self):
        """Takes a few bytes a second: nobody may wait for it."""
        with socket.create_connection((self.host, self.port)) as stream:
            stream.sendall(f"GET /camera/left HTTP/1.1\r\nHost: {self.host}:{self.port}\r\n\r\n".encode())
            while not self.ended.wait(1.0):
                try:
                    if not stream.recv(4096):
                        return
                except ConnectionResetError:  # who takes too little for too long is let go
                    return

    def come_and_go(self):
        tag = None
        while not self.ended.wait(1.0):
            self.watch_camera("right", parts=2)
            connection, answer = self.request("/scene", headers={"If-None-Match": tag} if tag else {})
            answer.read()
            tag = answer.getheader("ETag") or tag
            connection.close()
            self.json("/state")
            self.counters.add("visits")

    def operate(self):
        while not self.ended.wait(3.0):
            state = self.json("/state")
            if not state or state["work"]:
                continue
            stages = {stage["name"]: stage for stage in state["stages"]}
            now = stages[state["stage"]]
            if any(camera["trouble"] for camera in state["cameras"]):
                self.command(command="reconnect")
                self.counters.add("reconnected")
                self.ended.wait(10.0)
                continue
            later = [stage["name"] for stage in state["stages"] if stage["state"] != "done"]
            if now["state"] == "done" and later:
                self.command(command="stage", name=later[0])
            elif state["can"]["finish"] and now["have"] >= now["want"] and now["state"] != "done":
                self.command(command="finish")
            elif later and state["can"]["next"]:
                if self.command(command="next")[0] == 202:
                    self.counters.add("taken")
            elif state["can"]["repeat"]:
                if self.command(command="repeat")[0] == 202:
                    self.counters.add("taken")
            self.ended.wait(2.0)


def persist(page, task):
    """Streams that the program ends are opened again, and the end is a trouble; so are errors."""
    def body():
        while not page.ended.is_set():
            try:
                task()
            except Exception as error:  # every failure is a finding
                if not page.ended.is_set():
                    page.counters.trouble(f"{type(error).__name__}: {error}")
            page.ended.wait(1.0)
    threading.Thread(target=body, daemon=True).start()


def memory_mb(pid):
    with open(f"/proc/{pid}/status", encoding="ascii") as status:
        values = dict(line.split(":", 1) for line in status)
    return float(values["VmRSS"].split()[0]) / 1024, int(values["Threads"])


def slope_mb_per_hour(samples):
    """Least squares, and the sigma that the scatter of ten parts' means about it tells (single samples are not independent)."""
    size = max(1, len(samples) // 10)
    parts = [samples[i:i + size] for i in range(0, len(samples) - size + 1, size)]
    points = [tuple(sum(column) / len(part) for column in zip(*part)) for part in parts]
    n = len(points)
    if n < 4:
        return 0.0, float("inf")
    mean_t, mean_m = (sum(p[i] for p in points) / n for i in (0, 1))
    spread = sum((t - mean_t) ** 2 for t, _ in points)
    slope = sum((t - mean_t) * (m - mean_m) for t, m in points) / spread
    left = sum((m - mean_m - slope * (t - mean_t)) ** 2 for t, m in points)
    return 3600 * slope, 3600 * (left / (n - 2) / spread) ** 0.5


def main():
    crosstie = sys.argv[1]
    minutes = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    scene = sys.argv[3] if len(sys.argv) > 3 else "segment"
    counters = Counters()
    with tempfile.TemporaryDirectory() as folder:
        program = subprocess.Popen([crosstie, "live", os.path.join(folder, "job"), "--twin", scene, "--port", "0"],
                                   stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        page = Page(program.stdout.readline().strip(), counters)
        while page.json("/state") is None:
            time.sleep(0.5)
        for _ in range(WATCHERS):
            persist(page, page.watch_states)
            persist(page, lambda: page.watch_camera("left"))
            persist(page, lambda: page.watch_camera("right"))
        persist(page, page.hardly_read)
        persist(page, page.come_and_go)
        persist(page, page.operate)

        begin = time.time()
        samples, threads, said, state, complete = [], [], 0, None, None
        while time.time() - begin < 60 * minutes and program.poll() is None:
            time.sleep(2.0)
            memory, count = memory_mb(program.pid)
            samples.append((time.time() - begin, memory))
            threads.append(count)
            if time.time() - begin >= 60 * said:
                said += 1
                state = page.json("/state") or state
                if complete is None and all(stage["state"] == "done" for stage in state["stages"]):
                    complete = samples[-1][0]
                done = [f"{stage['name']} {stage['have']}/{stage['want']} {stage['state']}" for stage in state["stages"]]
                print(f"{samples[-1][0] / 60:5.1f} min  {memory:7.1f} MB  {count} threads  {state['pairs']}  "
                      f"{counters.states} states, {counters.pictures} pictures, {counters.taken} taken; {'; '.join(done)}", flush=True)
        state = page.json("/state") or state
        page.ended.set()
        died = program.poll()
        program.send_signal(signal.SIGINT)
        program.wait(60)

    begin = max((1 - SETTLED_SHARE) * samples[-1][0], complete if complete is not None else samples[-1][0])
    settled = [sample for sample in samples if sample[0] >= begin]
    told = samples[-1][0] - begin >= SHORTEST_S
    slope, sigma = slope_mb_per_hour(settled) if told else (0.0, float("inf"))
    if not told:
        print("growth of memory is not judged: the results were there too late (or never) for ten minutes of repeating")
    print(f"memory: {samples[0][1]:.1f} MB at first, {max(m for _, m in samples):.1f} at most, {samples[-1][1]:.1f} at last; slope of the "
          f"last {len(settled)} samples {slope:+.2f} +- {sigma:.2f} MB/h; threads {min(threads)} to {max(threads)}")
    shown = [(c["side"], c["frames"], c["dropped"], c["lost"], c["swapped"], c["incomplete"]) for c in state["cameras"]]
    print(f"pairs: {state['pairs']}; cameras (frames, dropped, lost, swapped, incomplete): {shown}")
    print(f"read: {counters.states} states, {counters.pictures} pictures, {counters.visits} visits, {counters.taken} commands to take, "
          f"{counters.reconnected} times connected again")
    for line in state["log"]:
        if line["level"] == "error":
            print(f"log: {line}")
    bad = list(counters.troubles)
    if died is not None:
        bad.append(f"the program ended with {died}")
    if slope - 2 * sigma > GROWTH_LIMIT_MB_PER_HOUR:
        bad.append(f"memory grows by {slope:.1f} MB an hour")
    if any(c["lost"] or c["incomplete"] for c in state["cameras"]):
        bad.append("frames were lost on their way")
    for text in bad:
        print(f"TROUBLE: {text}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
