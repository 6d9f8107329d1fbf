"""`understory convert RUN --to PG:...`: a PostGIS server of the test's own gets a run whole or not at all, without
doubles; and `convert RUN trees.geojson`. Skips where the server's programs are not installed."""

import glob
import json
import os
import pwd
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import program

FOUND = sorted(glob.glob("/usr/lib/postgresql/*/bin/initdb"))
EXTENSION = glob.glob("/usr/share/postgresql/*/extension/postgis.control")
SKIPPED = 77


class Server:
    """A server on a free port, owned by the user nobody where the test runs as root: PostgreSQL refuses root."""

    def __init__(self):
        self.bin = Path(FOUND[-1]).parent
        self.user = "nobody" if os.geteuid() == 0 else pwd.getpwuid(os.geteuid()).pw_name
        self.folder = Path(tempfile.mkdtemp(prefix="understory-pg-"))
        if os.geteuid() == 0:
            shutil.chown(self.folder, self.user)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.as_owner("initdb", "-D", self.folder / "data", "-A", "trust", "-U", "tester", "--no-sync")
        self.start()
        self.sql("postgres", "create database forest")

    def as_owner(self, name, *words):
        command = [str(self.bin / name), *map(str, words)]
        if os.geteuid() == 0:
            command = ["setpriv", f"--reuid={self.user}", "--clear-groups", *command]
        # A server inherits no pipe: it would keep it open.
        with open(self.folder.parent / f"{self.folder.name}.log", "w") as log:
            done = subprocess.run(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL, cwd="/")
        assert done.returncode == 0, Path(log.name).read_text()

    def start(self):
        self.as_owner("pg_ctl", "-D", self.folder / "data", "-w", "-l", self.folder / "server.log", "-o",
                      f"-p {self.port} -c listen_addresses=127.0.0.1 -c unix_socket_directories='' -c fsync=off",
                      "start")

    def stop(self, how="immediate"):
        self.as_owner("pg_ctl", "-D", self.folder / "data", "-m", how, "-w", "stop")

    def psql(self, database):
        return [str(self.bin / "psql"), "-h", "127.0.0.1", "-p", str(self.port), "-U", "tester", "-X", "-q", "-A", "-t",
                "-v", "ON_ERROR_STOP=1", database]

    def sql(self, database, text):
        done = subprocess.run([*self.psql(database), "-c", text], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    def target(self, database="forest"):
        return f"PG:host=127.0.0.1 port={self.port} user=tester dbname={database}"

    def remove(self):
        try:
            self.stop()
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)
            Path(f"{self.folder}.log").unlink(missing_ok=True)


def placed_run(folder, name, shift=0.0):
    """A run folder with a trees.gpkg in EPSG:3067, as `inventory` writes it of a cloud in that system."""
    import numpy as np
    import laspy
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = [385000, 6672000, 0], [0.001] * 3
    draw = np.random.default_rng(5)
    parts = []
    gx, gy = np.meshgrid(np.arange(0, 24, 0.15), np.arange(0, 24, 0.15))
    parts.append(np.column_stack([gx.ravel(), gy.ravel(), draw.normal(0, 0.01, gx.size)]))
    for k in range(12):
        x, y, r, n = 4 + 5 * (k % 4), 5 + 6 * (k // 4), 0.1 + 0.01 * k, 5000
        turn, up = draw.uniform(0, 2 * np.pi, n), draw.uniform(0, 12, n)
        radius = r * (1 - 0.04 * up)
        parts.append(np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn), up]))
    points = np.vstack(parts) + [385000 + shift, 6672000, 100]
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(folder / f"{name}.las")
    done = program("inventory", folder / f"{name}.las", "-o", folder / name, "--crs", "EPSG:3067", "--up", "z")
    assert (folder / name / "trees.gpkg").exists(), done
    return folder / name


class InOrder:
    """Named checks, one after the other: they share one server. The first failure ends the test."""

    def __init__(self):
        self.cases = []

    def case(self, name):
        def add(function):
            self.cases.append((name, function))
            return function
        return add

    def run(self):
        for name, function in self.cases:
            with tempfile.TemporaryDirectory() as folder:
                print("ok", name, function(Path(folder)) or "", flush=True)


def trees_in(package):
    with sqlite3.connect(package) as connection:
        return connection.execute("select count(*) from trees").fetchone()[0]


def main():
    if not FOUND or not EXTENSION:
        print("skipped: no PostgreSQL server with PostGIS is installed")
        sys.exit(SKIPPED)
    server = Server()
    try:
        run_cases(server)
    finally:
        server.remove()


def run_cases(server):
    cases = InOrder()
    runs = Path(tempfile.mkdtemp(prefix="understory-runs-"))
    run, other = placed_run(runs, "plot"), placed_run(runs, "other", shift=500.0)
    count = trees_in(run / "trees.gpkg")
    assert count >= 10, count

    def convert(folder=run, *more, database="forest"):
        return program("convert", folder, "--to", server.target(database), *more)

    @cases.case("a run, twice, and a second run beside it")
    def twice(folder):
        for round_ in range(2):
            done = convert()
            assert done.returncode == 0 and f"{count} trees" in done.stdout, done
            assert ("replaces" in done.stdout) == (round_ == 1), done
        assert server.sql("forest", "select count(*), count(distinct id) from understory.trees") == f"{count}|{count}"
        # A GeoPackage of the user's beside the run stays out.
        shutil.copy(run / "trees.gpkg", other / "plots.gpkg")
        assert convert(other).returncode == 0
        assert server.sql("forest", "select count(*) from understory.trees") == str(count + trees_in(other / "trees.gpkg"))
        assert server.sql("forest", "select count(*) from understory.runs") == "2"
        # Places and figures are those of the GeoPackage.
        with sqlite3.connect(run / "trees.gpkg") as package:
            wanted = dict(package.execute("select id, dbh_m from trees"))
        told = server.sql("forest", "select t.id, t.dbh_m, st_srid(t.geom), st_x(t.geom), st_z(t.geom) from "
                          "understory.trees t join understory.runs r using (run_id) where r.name = 'plot'")
        for row in told.splitlines():
            tree, dbh, srid, x, z = row.split("|")
            assert srid == "3067" and 385000 < float(x) < 385030 and abs(float(z) - 100) < 0.5, row
            assert (dbh == "") == (wanted[int(tree)] is None), row
            assert dbh == "" or float(dbh) == wanted[int(tree)], row
        return f"{count} trees"

    @cases.case("another layout, a foreign schema and another system are refused")
    def refused(folder):
        before = server.sql("forest", "select count(*) from understory.trees")
        server.sql("forest", "update understory.layout set version = 99")
        done = convert()
        assert done.returncode == 3 and "layout 99" in done.stderr, done
        server.sql("forest", "update understory.layout set version = 1, srid = 25832")
        done = convert()
        assert done.returncode == 3 and "EPSG:25832" in done.stderr, done
        server.sql("forest", "update understory.layout set srid = 3067")
        server.sql("forest", "create schema foreign_one")
        done = convert(run, "--schema", "foreign_one")
        assert done.returncode == 3 and "did not make it" in done.stderr, done
        assert server.sql("forest", "select count(*) from understory.trees") == before
        assert convert(run, "--schema", "a \"b' c").returncode == 0
        assert convert().returncode == 0

    @cases.case("a database that goes away in the middle")
    def lost(folder):
        server.sql("postgres", "create database fresh")
        assert convert(other, database="fresh").returncode == 0
        held = server.sql("fresh", "select count(*) from understory.trees")
        # A lock holds the transfer in the midst of its transaction.
        lock = subprocess.Popen([*server.psql("fresh"), "-c", "begin", "-c", "lock table understory.trees", "-c",
                                 "select pg_sleep(60)"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        waiting = "select count(*) from pg_stat_activity where application_name = 'understory' and wait_event_type = 'Lock'"
        process = None
        try:
            wait_for(lambda: server.sql("fresh", "select count(*) from pg_locks where relation = 'understory.trees'::regclass "
                                        "and mode = 'AccessExclusiveLock' and granted") == "1")
            process = subprocess.Popen([os.environ["UNDERSTORY_PROGRAM"], "convert", run, "--to", server.target("fresh")],
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            wait_for(lambda: server.sql("fresh", waiting) == "1")
            server.stop("immediate")
            _, said = process.communicate(timeout=60)
        finally:
            if process is not None and process.poll() is None:
                process.kill()
            lock.kill()
            lock.wait()
            server.start()
        assert process.returncode == 3 and "nothing was written" in said, (process.returncode, said)
        assert server.sql("fresh", "select count(*) from understory.trees") == held
        assert server.sql("fresh", "select count(*) from understory.runs") == "1"
        assert convert(database="fresh").returncode == 0
        assert server.sql("fresh", "select count(*) from understory.runs") == "2"

    @cases.case("stopped by the user, and servers that are not there")
    def stopped(folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        done = program("convert", run, "--to", f"PG:host=127.0.0.1 port={port} password=secret dbname=x")
        assert done.returncode == 3 and "no connection" in done.stderr and "secret" not in done.stderr, done
        assert convert(database="no_such_one").returncode == 3
        for wrong in ("PG:nonsense=1", "forest", "PG:host"):
            done = program("convert", run, "--to", wrong)
            assert done.returncode == 2 and "PG:host" in done.stderr, done
        assert program("convert", run, "out.mcap", "--to", server.target()).returncode == 2
        assert program("convert", run).returncode == 2
        assert program("convert", folder, "--to", server.target()).returncode == 3

    @cases.case("GeoJSON of a run")
    def geojson(folder):
        out = folder / "trees.geojson"
        done = program("convert", run, out)
        assert done.returncode == 0 and f"{count} trees" in done.stdout, done
        features = json.loads(out.read_text())["features"]
        assert len(features) == count
        told = server.sql("forest", "select t.id, st_x(g), st_y(g) from understory.trees t join understory.runs r using (run_id), "
                          "st_transform(t.geom, 4326) g where r.name = 'plot'")
        places = {int(a): (float(b), float(c)) for a, b, c in (row.split("|") for row in told.splitlines())}
        for feature in features:
            x, y = feature["geometry"]["coordinates"]
            wanted = places[feature["properties"]["id"]]
            assert abs(x - wanted[0]) < 1e-7 and abs(y - wanted[1]) < 1e-7, (feature, wanted)
        assert program("convert", run, out).returncode == 3, "a file that is there was replaced"
        assert program("convert", run / "trees.gpkg", out, "--overwrite").returncode == 0
        crowns = folder / "crowns.geojson"
        none = program("convert", run, crowns, "--layer", "stems")
        assert none.returncode == 3 and "the file has trees" in none.stderr and not crowns.exists(), none
        wrong = program("convert", run, folder / "walk.mcap", "--layer", "path")
        assert wrong.returncode == 2 and "--layer" in wrong.stderr, wrong
        return f"{count} trees where PostGIS has them"

    try:
        cases.run()
    finally:
        shutil.rmtree(runs, ignore_errors=True)


def wait_for(holds, seconds=30):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.1)


main()
