-- SPDX-License-Identifier: Apache-2.0
-- The faults of frames: the codes that converters, the Manager and links report in frame_error_code.
-- `make constants` writes them from fusesoc_firm/frame/faults.py.
library ieee;
use ieee.std_logic_1164.all;

package firm_fault_pkg is

  subtype fault_t is std_logic_vector(3 downto 0);

  constant NO_FAULT     : fault_t := "0000";
  -- the length is not that of the message
  constant BAD_LENGTH   : fault_t := "0001";
  -- the frame or a part of it ended early
  constant SHORT_FRAME  : fault_t := "0010";
  -- the frame or a part of it continued after its length
  constant LONG_FRAME   : fault_t := "0011";
  -- the encoding is unknown
  constant BAD_ENCODING : fault_t := "0100";
  -- a count exceeds its bound, or a text lacks its terminating zero
  constant BAD_COUNT    : fault_t := "0101";
  -- the payload is longer than the publisher's buffer
  constant OVER_BUFFER  : fault_t := "0110";
  -- the payload is longer than maxLength
  constant TOO_LONG     : fault_t := "0111";
  -- a beat is neither full nor the last one, is empty, or has gaps
  constant BROKEN_BEAT  : fault_t := "1000";
  -- the watchdog ended the frame
  constant WATCHDOG     : fault_t := "1001";
  -- the sender aborted the frame
  constant ABORTED      : fault_t := "1010";
  -- a full queue dropped the frame
  constant DROPPED      : fault_t := "1011";
  -- the checksum of a link is wrong
  constant BAD_CHECKSUM : fault_t := "1100";

end package firm_fault_pkg;
