"""A new policy is a row of the table, a model and an entity: added to a copy of the project, it passes all tests."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.hdl.ghdl import CORES, REPOSITORY
from tools.policies.lists import files

ROW = '    Policy("last_first", "Last first"),\n'
MODEL = '''"""The highest index first."""

from fusesoc_firm.scheduling.models.base import Bools, Generics, Ints
from fusesoc_firm.scheduling.models.choosing import ChoosingScheduler


class LastFirst(ChoosingScheduler):
    """Non-preemptive."""

    def _choose(self, eligible: Bools) -> Ints:
        return self.requesters - 1 - eligible[:, ::-1].argmax(axis=1)


def last_first(generics: Generics) -> LastFirst:
    return LastFirst(generics.batch, generics.requesters)
'''
ENTITY = """library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;
library firm;
use firm.firm_axis_pkg.all;
entity firm_sched_last_first is
  generic (REQUESTERS : integer := 2);
  port (
    clk, rst_n   : in std_logic;
    request      : in std_logic_vector(REQUESTERS-1 downto 0);
    beat, last   : in std_logic;
    grant_valid  : out std_logic;
    grant_select : out std_logic_vector(index_bits(REQUESTERS)-1 downto 0));
end entity firm_sched_last_first;

architecture rtl of firm_sched_last_first is
  signal granted_r : natural range 0 to REQUESTERS-1;
  signal started_r : std_logic;  -- the granted task has had a beat and needs more
begin
  choose : process (clk)
  begin
    if rising_edge(clk) then
      started_r <= (started_r or beat) and not (beat and last);
      if ((started_r or beat) and not (beat and last)) = '0' then
        for requester in 0 to REQUESTERS-1 loop
          if request(requester) = '1' and not (requester = granted_r and beat = '1') then
            grant_valid <= '1';
            granted_r   <= requester;
          end if;
        end loop;
      end if;
      if rst_n = '0' then
        started_r   <= '0';
        grant_valid <= '0';
        granted_r   <= 0;
      end if;
    end if;
  end process choose;
  grant_select <= std_logic_vector(to_unsigned(granted_r, index_bits(REQUESTERS)));
end architecture rtl;
"""
TESTS = (
    "tests/cores/test_sched_models.py::test_grants_are_those_of_the_model[last_first-5]",
    "tests/system/simulated/test_scheduled_system.py::test_every_message_comes_back[last_first-8]",
)


def test_a_row_a_model_and_an_entity_are_a_policy(tmp_path: Path) -> None:
    for name in (
        "fusesoc_firm",
        "cores",
        "tests/cores",
        "tests/hdl",
        "tests/system",
        "tools/dissertation",
        "tools/policies",
    ):
        shutil.copytree(REPOSITORY / name, tmp_path / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for path in (REPOSITORY / "pyproject.toml", *REPOSITORY.glob("tests/*.py")):
        shutil.copy(path, tmp_path / path.relative_to(REPOSITORY))
    table = tmp_path / "fusesoc_firm/scheduling/policies.py"
    table.write_text(table.read_text().replace("\n)\n\nPOLICIES:", f"\n{ROW})\n\nPOLICIES:"), encoding="utf-8")
    (table.parent / "models" / "last_first.py").write_text(MODEL, encoding="utf-8")
    (tmp_path / "cores/sched/rtl/firm_sched_last_first.vhd").write_text(ENTITY, encoding="ascii")

    python(tmp_path, "-m", "tools.policies")
    python(tmp_path, "-m", "pytest", "-n0", "-q", *TESTS)


def python(folder: Path, *arguments: str) -> None:
    """Run Python with the packages in `folder`."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_cores_list_the_policies_of_the_table() -> None:
    """`make policies` puts it right."""
    for path, text in files(CORES / "sched").items():
        assert path.read_text(encoding="ascii") == text, path
