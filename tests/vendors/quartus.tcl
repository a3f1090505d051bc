# Quartus' commands as far as the projects of Edalize and their constraints use them.
#
#   tclsh quartus.tcl PROJECT.tcl      in the work folder; writes a line a clock and a constraint
#
# Sources: Intel Quartus Prime Standard Edition User Guides, Scripting (project, assignments) and Timing Analyzer (SDC).

set tools [file dirname [file normalize [info script]]]
source [file join $tools common.tcl]

set assigned {}
set constraints {}
set clocks {}
proc project_new {name args} { options {-overwrite} {} $args }
proc set_global_assignment {args} {
  lassign [options {} {-name -library} $args] given value
  set value [lindex $value 0]
  switch [dict get $given -name] {
    FAMILY - DEVICE - TOP_LEVEL_ENTITY { dict set ::assigned [dict get $given -name] $value }
    VHDL_FILE { read_vhdl $value }
    VERILOG_FILE - SYSTEMVERILOG_FILE { existing $value }
    SDC_FILE { lappend ::constraints [existing $value] }
    SEARCH_PATH { if {![file isdirectory $value]} { wrong "there is no folder $value" } }
    default { wrong "unknown assignment [dict get $given -name]" }
  }
}

proc get_ports {name} {
  set ports [dict get $::entities [string tolower [dict get $::assigned TOP_LEVEL_ENTITY]]]
  if {![dict exists $ports $name]} { wrong "there is no port $name" }
  return $name
}
proc create_clock {args} {
  lassign [options {} {-name -period} $args] given port
  if {![string is double -strict [dict get $given -period]]} { wrong "the period is [dict get $given -period]" }
  lappend ::clocks [dict get $given -name]
  puts "clock [dict get $given -name] $port [dict get $given -period]"
}
proc derive_clock_uncertainty {} {}
proc get_clocks {name} {
  if {$name ni $::clocks} { wrong "there is no clock $name" }
  return $name
}
proc get_pins {args} {
  set name [lindex [options {-compatibility_mode} {} $args] 1]
  instances [lrange [split $name |] 0 end-2]
  return $name
}
proc get_registers {args} {
  lassign [options {-compatibility_mode} {} $args] given name
  instances [lrange [split $name |] 0 end-1]
  return $name
}
proc delay {what arguments} {
  lassign [options {} {-from -to} $arguments] given nanoseconds
  if {![string is double -strict [lindex $nanoseconds 0]]} { wrong "the delay is $nanoseconds" }
  set sink [expr {[dict exists $given -to] ? [dict get $given -to] : ""}]
  puts [concat $what [dict get $given -from] $sink $nanoseconds]
}
proc set_max_skew {args} { delay max_skew $args }
proc set_max_delay {args} { delay max_delay $args }
proc set_min_delay {args} { delay min_delay $args }
proc set_false_path {args} { puts "false_path [dict get [lindex [options {} {-to} $args] 0] -to]" }

or_leave {
  source [lindex $argv 0]
  foreach name {FAMILY DEVICE TOP_LEVEL_ENTITY} {
    if {![dict exists $assigned $name]} { wrong "$name is not assigned" }
  }
  if {![dict exists $entities [string tolower [dict get $assigned TOP_LEVEL_ENTITY]]]} {
    wrong "there is no top level [dict get $assigned TOP_LEVEL_ENTITY]"
  }
  check_instances
  if {$constraints eq ""} { wrong "there are no constraints" }
  foreach name $constraints { source $name }
}
