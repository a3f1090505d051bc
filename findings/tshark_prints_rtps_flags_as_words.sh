#!/bin/sh
# Guess:    `tshark -T fields` prints a flag of an RTPS submessage as the 1 or 0 that display filters and older scripts
#           compare with.
# Really:   since Wireshark 4.2 it prints True or False. A script that compares with 1 finds no submessage with the
#           flag, without an error. The display filter `rtps.flag.data_present == 1` matches in both versions.
# Versions: TShark 4.0.17 (Debian 12) prints 1, 4.4.19 (Debian 13) prints True; the script knows both
# Source:   the release notes of Wireshark 4.2.0
# Met by:   authors of tests that read captures of ROS 2 with tshark
set -eu
for program in tshark text2pcap; do
  command -v $program > /dev/null || { echo "needs $program, such as Debian 12: apt-get install tshark=4.0.17-0+deb12u3" >&2; exit 2; }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# One RTPS message: header, INFO_TS, and DATA with its little-endian and its data flag.
cat > message.txt <<'HEX'
0000 52 54 50 53 02 03 01 0f 00 01 02 03 04 05 06 07
0010 08 09 0a 0b 09 01 08 00 00 00 00 00 00 00 00 00
0020 15 05 1c 00 00 00 10 00 00 00 01 03 00 00 01 04
0030 00 00 00 00 01 00 00 00 00 01 00 00 05 00 00 00
HEX
text2pcap -q -u 7410,7411 message.txt message.pcap 2> log || { cat log; exit 1; }
version=$(tshark --version 2> /dev/null | sed -n 's/^TShark (Wireshark) \([0-9.]*[0-9]\).*/\1/p')
printed=$(tshark -r message.pcap -T fields -e rtps.flag.data_present 2> log)
filtered=$(tshark -r message.pcap -Y 'rtps.flag.data_present == 1' 2> log | wc -l)
case $version in
  [0-3].* | 4.[01].*) expected=1 ;;
  *) expected=True ;;
esac
echo "TShark $version"
echo "guess: 1 in each version"
echo "seen:  $printed; the filter '== 1' matches $filtered packet"
[ "$printed" = "$expected" ] && [ "$filtered" = 1 ]
