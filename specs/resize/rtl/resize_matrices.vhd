-- SPDX-License-Identifier: Apache-2.0
-- Doubles the matrices K and P and the region of interest in a sensor_msgs/CameraInfo. Of the matrices, only the first
-- two rows are in pixels and double, as in image_proc; the third row has no unit.
library ieee;
use ieee.std_logic_1164.all;
use ieee.numeric_std.all;

entity resize_matrices is
  port (
    clk   : in std_logic;
    rst_n : in std_logic;

    in_k              : in  std_logic_vector(575 downto 0);
    in_p              : in  std_logic_vector(767 downto 0);
    in_roi_x_offset   : in  std_logic_vector(31 downto 0);
    in_roi_y_offset   : in  std_logic_vector(31 downto 0);
    in_roi_height     : in  std_logic_vector(31 downto 0);
    in_roi_width      : in  std_logic_vector(31 downto 0);
    in_roi_do_rectify : in  std_logic;
    in_segment_valid  : in  std_logic_vector(0 downto 0);
    in_msg_valid      : in  std_logic;
    in_msg_ready      : out std_logic;

    out_k              : out std_logic_vector(575 downto 0);
    out_p              : out std_logic_vector(767 downto 0);
    out_roi_x_offset   : out std_logic_vector(31 downto 0);
    out_roi_y_offset   : out std_logic_vector(31 downto 0);
    out_roi_height     : out std_logic_vector(31 downto 0);
    out_roi_width      : out std_logic_vector(31 downto 0);
    out_roi_do_rectify : out std_logic;
    out_segment_valid  : out std_logic_vector(0 downto 0);
    out_msg_ready      : in  std_logic
  );
end entity resize_matrices;

architecture rtl of resize_matrices is

  constant INFINITE : std_logic_vector(10 downto 0) := (others => '1');

  -- Twice a float64, exactly: its exponent grows by one. A subnormal number shifts, if need be into a normal one. The
  -- largest numbers become infinite; infinity and NaN are unchanged.
  function doubled(number : std_logic_vector(63 downto 0)) return std_logic_vector is
    variable exponent : unsigned(10 downto 0);
    variable result   : std_logic_vector(63 downto 0);
  begin
    exponent := unsigned(number(62 downto 52));
    result   := number;
    if exponent = 0 then
      result(62 downto 0) := number(61 downto 0) & '0';
    elsif exponent = 2046 then
      result(62 downto 0) := INFINITE & (51 downto 0 => '0');
    elsif exponent /= 2047 then
      result(62 downto 52) := std_logic_vector(exponent + 1);
    end if;
    return result;
  end function doubled;

  -- The first two rows of a matrix of three.
  function doubled_rows(matrix : std_logic_vector; columns : positive) return std_logic_vector is
    variable result : std_logic_vector(matrix'length-1 downto 0);
  begin
    result := matrix;
    for element in 0 to 2*columns-1 loop
      result(64*element+63 downto 64*element) := doubled(result(64*element+63 downto 64*element));
    end loop;
    return result;
  end function doubled_rows;

begin

  out_k              <= doubled_rows(in_k, 3);
  out_p              <= doubled_rows(in_p, 4);
  out_roi_x_offset   <= in_roi_x_offset(30 downto 0) & '0';
  out_roi_y_offset   <= in_roi_y_offset(30 downto 0) & '0';
  out_roi_height     <= in_roi_height(30 downto 0) & '0';
  out_roi_width      <= in_roi_width(30 downto 0) & '0';
  out_roi_do_rectify <= in_roi_do_rectify;

  out_segment_valid <= (others => in_msg_valid);
  in_msg_ready      <= in_msg_valid and out_msg_ready;

end architecture rtl;
