# Vivado's commands as far as projects with block designs use them: they do nothing but remember and check.
#
#   tclsh vivado.tcl PROJECT.tcl      in the work folder; writes a line a cell, net and port
#
# The variable VIVADO_VERSION is the release, 2026.1 if it is not set. After that, the checks of the routed design run,
# in which VIVADO_FINDS are faults.
#
# A command that is not here is unknown to Tcl, an option or a property that is not here to `options` and `legal`.
# Sources: UG835 (Tcl commands), UG912 (properties), UG994 (block designs), UG903 (constraints), UG1399 (Vitis HLS).

set tools [file dirname [file normalize [info script]]]
source [file join $tools common.tcl]

# --- the catalog of IP ---------------------------------------------------------------------------------------------

set catalog {}
proc ip {name body} {
  set ::declared $name
  dict set ::catalog $name {property {} pin {} interface {} space {} segment {} rule {} automation {}}
  eval $body
}
proc note {what args} { dict set ::catalog $::declared $what {*}$args }
proc property {name default values} { note property $name [list $default $values] }
proc pin {name direction kind width {condition 1}} { note pin $name [list $direction $kind $width $condition] }
proc interface {name mode {condition 1}} { note interface $name [list $mode $condition] }
proc space {name} { note space $name 1 }
proc segment {name} { note segment $name 1 }
proc rule {condition} { note rule $condition 1 }
proc automation {settings} { note automation $settings }
run_script [file join $tools ip.tcl]

# --- the project ---------------------------------------------------------------------------------------------------

proc variable_of {name default} { expr {[info exists ::env($name)] ? $::env($name) : $default} }
set release [variable_of VIVADO_VERSION 2026.1]
set finds [variable_of VIVADO_FINDS ""]
set project {}
set constraints {}
set kernels {}
set files {}
set is_ordered 0
# By object; UG912.
set project_properties {
  current_project {part board_part target_language source_mgmt_mode ip_repo_paths}
  sources_1 {include_dirs top}
  .bd {synth_checkpoint_mode}
  .xdc {used_in_synthesis}
  impl_1 {STEPS.ROUTE_DESIGN.TCL.POST}
}
set board_parts {
  tul.com.tw:pynq-z2:part0:1.0 xc7z020clg400-1 xilinx.com:zcu104:part0:1.1 xczu7ev-ffvc1156-2-e
  xilinx.com:kr260_som:part0:1.1 xck26-sfvc784-2LV-c
}

proc create_project {name args} { options {-force} {} $args; dict set ::project name $name }
proc current_project {} { return current_project }
proc current_fileset {} { return sources_1 }
proc get_filesets {name} {
  if {$name ne "sources_1"} { wrong "unknown fileset $name" }
  return $name
}
proc get_runs {name} {
  if {$name ne "impl_1"} { wrong "there is no run $name" }
  return $name
}
proc update_compile_order {args} { lassign [options {} {-fileset} $args]; set ::is_ordered 1 }
proc read_verilog {args} { foreach name [lindex [options {-sv} {} $args] 1] { existing $name } }
proc read_xdc {args} {
  foreach name [lindex [options {-unmanaged} {} $args] 1] {
    lappend ::constraints [existing $name]
    lappend ::files [file tail $name]
  }
}

proc get_files {name} {
  if {$name ni $::files} { wrong "the project has no file $name" }
  return $name
}
proc generate_target {what name} {
  if {$what ne "all"} { wrong "unknown target $what" }
  dict set ::project generated $name 1
}

proc get_property {name object} {
  if {[string match path_* $object]} { return [property_of_path $name $object] }
  if {$object ne "current_project" || $name ni [dict get $::project_properties $object]} {
    wrong "unknown property $name of $object"
  }
  expr {[dict exists $::project $name] ? [dict get $::project $name] : ""}
}
proc set_property {args} {
  lassign [options {} {-dict} $args] given rest
  if {[dict exists $given -dict]} {
    set pairs [dict get $given -dict]
    set object [lindex $rest 0]
  } else {
    set pairs [lrange $rest 0 1]
    set object [lindex $rest 2]
  }
  foreach {name value} $pairs { set_one $name $value $object }
}
proc set_one {name value object} {
  if {[dict exists $::cells $object]} { return [configure $object $name $value] }
  if {$name eq "CONFIG.ASSOCIATED_BUSIF"} {
    foreach bus [split $value :] {
      set path [file dirname $object]/$bus
      if {![is_module_bus $path] && ![is_module_stream $path]} { wrong "there is no interface $path" }
      lappend ::associated $path
    }
    return
  }
  set kind [expr {$object in $::files ? [file extension $object] : $object}]
  if {![dict exists $::project_properties $kind] || $name ni [dict get $::project_properties $kind]} {
    wrong "unknown property $name of $object"
  }
  if {$name eq "board_part" && [dict get $::board_parts $value] ne [dict get $::project part]} {
    wrong "board $value does not have the part [dict get $::project part]"
  }
  dict set ::project $name $value
}

# --- C++ by Vitis HLS ------------------------------------------------------------------------------------------------

proc update_ip_catalog {} {}
proc exec {program args} {
  switch $program {
    vitis_hls { set form {-f * >@stdout 2>@stderr} }
    vitis-run { set form {--mode hls --tcl * >@stdout 2>@stderr} }
    default { wrong "unknown program $program" }
  }
  if {![string match $form $args]} { wrong "$program does not take $args" }
  lappend ::kernels [run_hls [existing [lindex $args end-2]]]
}
# UG1399, Vitis HLS Command Reference; gives the VLNV of what is exported.
proc run_hls {script} {
  set hls [interp create]
  $hls eval {
    rename exit leave
    rename source run_script
    set done {}
    proc step {name after} {
      global done
      if {$after ni $done && $after ne ""} { error "$name before $after" }
      lappend done $name
    }
    proc open_project {option name} {
      if {$option ne "-reset"} { error "unknown option $option" }
      set ::project $name
      step open_project ""
    }
    proc set_top {name} { set ::top $name; step set_top open_project }
    proc add_files {name} {
      if {![file isfile $name]} { error "there is no file $name" }
      set channel [open $name]
      append ::text [read $channel]
      close $channel
      step add_files open_project
    }
    proc open_solution {args} {
      if {$args ne {-reset -flow_target vivado solution}} { error "open_solution $args" }
      step open_solution add_files
    }
    proc set_part {name} { set ::part $name; step set_part open_solution }
    proc create_clock {args} {
      if {[lindex $args 0] ne "-period" || ![string is double -strict [lindex $args 1]]} { error "create_clock $args" }
      if {[lrange $args 2 end] ne {-name default}} { error "create_clock $args" }
      step create_clock open_solution
    }
    proc csynth_design {} {
      if {![regexp "void\\s+$::top\\s*\\(" $::text]} { error "no function $::top" }
      step csynth_design set_part
    }
    proc export_design {args} {
      set given $args
      if {[lsort [dict keys $given]] ne {-format -library -vendor -version}} { error "export_design $args" }
      if {[dict get $given -format] ne "ip_catalog"} { error "the form is [dict get $given -format]" }
      step export_design csynth_design
      set ::vlnv [join [list [dict get $given -vendor] [dict get $given -library] $::top [dict get $given -version]] :]
    }
    proc exit {} { step exit export_design }
  }
  $hls eval [list run_script $script]
  if {"exit" ni [$hls eval {set done}]} { wrong "$script does not leave Vitis HLS" }
  if {[$hls eval {set part}] ne [dict get $::project part]} { wrong "$script is for another part" }
  list [$hls eval {set vlnv}] [$hls eval {set project}]
}
proc create_ip {args} {
  lassign [options {} {-vlnv -module_name} $args] given
  foreach kernel $::kernels {
    lassign $kernel vlnv folder
    set place [file normalize $folder/solution/impl/ip]
    if {$vlnv eq [dict get $given -vlnv] && $place in [get_property ip_repo_paths current_project]} {
      set name [dict get $given -module_name]
      lappend ::files $name.xci
      dict set ::entities [string tolower $name] {}
      return
    }
  }
  wrong "the catalog has no [dict get $given -vlnv]"
}

# --- block designs ---------------------------------------------------------------------------------------------------

set cells {}
set nets {}
set links {}
set ports {}
set design ""

# Inline utilities are there from 2024.2 on, and from 2026.1 on, they have no twins among the IP.
set inline {ilconcat}
set replaced {xlconcat}
proc is_available {library name} {
  if {![dict exists $::catalog $name] || ($library eq "inline_hdl") != ($name in $::inline)} { return 0 }
  expr {$name in $::inline ? $::release >= 2024.2 : $name in $::replaced ? $::release < 2026.1 : 1}
}
proc get_ipdefs {args} {
  lassign [options {-quiet -all} {} $args] given pattern
  lassign [split $pattern :] vendor library name version
  expr {[is_available $library $name] ? [list $vendor:$library:$name:1.0] : {}}
}

proc create_bd_design {name} {
  set ::design $name
  lappend ::files $name.bd
}
proc create_bd_cell {args} {
  lassign [options {} {-type -vlnv -reference} $args] given rest
  set cell [lindex $rest 0]
  if {[dict exists $::cells $cell]} { wrong "there is a cell $cell already" }
  switch [dict get $given -type] {
    module {
      set entity [string tolower [dict get $given -reference]]
      if {!$::is_ordered} { wrong "the hierarchy of sources is not known yet" }
      if {![dict exists $::entities $entity]} { wrong "there is no entity $entity" }
      dict set ::cells $cell [dict create entity $entity]
    }
    ip - inline_hdl {
      lassign [split [dict get $given -vlnv] :] vendor library name version
      if {$vendor ne "xilinx.com" || $library ne [dict get $given -type] || ![is_available $library $name]} {
        wrong "unknown IP [dict get $given -vlnv]"
      }
      set properties {}
      dict for {property fact} [dict get $::catalog $name property] { dict set properties $property [lindex $fact 0] }
      dict set ::cells $cell [dict create ip $name properties $properties]
    }
    default { wrong "unknown type of cell" }
  }
  return $cell
}
proc get_bd_cells {name} {
  if {![dict exists $::cells $name]} { wrong "there is no cell $name" }
  return $name
}
proc configure {cell name value} {
  if {![dict exists $::cells $cell ip]} { wrong "$cell has no property $name" }
  set ip [dict get $::cells $cell ip]
  if {![regexp {^CONFIG\.(\w+?)(\.VALUE_SRC)?$} $name all property source]} { wrong "unknown property $name" }
  if {![dict exists $::catalog $ip property $property]} { wrong "unknown property $property of $ip" }
  if {$source ne ""} {
    if {$value ne "USER"} { wrong "$name cannot be $value" }
    return
  }
  set values [lindex [dict get $::catalog $ip property $property] 1]
  if {![legal $value $values]} { wrong "$property of $cell cannot be $value; legal: $values" }
  dict set ::cells $cell properties $property $value
}
proc apply_bd_automation {args} {
  lassign [options {} {-rule -config} $args] given cell
  set ip [dict get $::cells [lindex $cell 0] ip]
  if {[dict get $given -rule] ne "xilinx.com:bd_rule:$ip"} { wrong "unknown rule [dict get $given -rule]" }
  set settings [dict get $::catalog $ip automation]
  dict for {name value} [dict get $given -config] {
    if {![dict exists $settings $name]} { wrong "unknown setting $name of [dict get $given -rule]" }
    if {$value ni [dict get $settings $name] && "\"$value\"" ne [dict get $settings $name]} {
      wrong "$name cannot be $value"
    }
    if {$name eq "apply_board_preset" && $value && ![dict exists $::project board_part]} {
      wrong "there is no board to take a preset of"
    }
  }
  dict set ::cells [lindex $cell 0] automated 1
}

# The value of an expression of a cell's properties.
proc valued {cell expression} {
  if {[lindex $expression 1] eq ".."} { return $expression }
  dict with ::cells $cell properties { expr $expression }
}
# Direction, kind and width of a pin: those of the entity, or the catalog's.
proc fact_of {path} {
  if {[dict exists $::ports $path]} { return [dict get $::ports $path] }
  lassign [split $path /] cell name
  if {[dict exists $::cells $cell entity]} {
    set entity [dict get $::cells $cell entity]
    if {![dict exists $::entities $entity [string tolower $name]]} { wrong "$entity has no port $name" }
    lassign [dict get $::entities $entity [string tolower $name]] direction width
    set kind [expr {$name eq "rst_n" ? "reset_n" : [string match clk* $name] ? "clock" : "data"}]
    return [list $direction $kind $width]
  }
  if {![dict exists $::cells $cell]} { wrong "there is no cell $cell" }
  set ip [dict get $::cells $cell ip]
  if {![dict exists $::catalog $ip pin $name]} { wrong "$ip has no pin $name" }
  lassign [dict get $::catalog $ip pin $name] direction kind width condition
  if {![valued $cell $condition]} { wrong "$path is not there, as the properties are" }
  list $direction $kind [valued $cell $width]
}
proc get_bd_pins {path} {
  if {![string match */* $path]} { wrong "there is no pin $path" }
  fact_of $path
  return $path
}
proc get_bd_ports {name} {
  if {![dict exists $::ports $name]} { wrong "there is no port $name" }
  return $name
}
proc create_bd_port {args} {
  lassign [options {} {-dir -from -to} $args] given name
  set name [lindex $name 0]
  if {[dict exists $::ports $name]} { wrong "there is a port $name already" }
  set width [expr {[dict exists $given -from] ? [dict get $given -from] - [dict get $given -to] + 1 : 1}]
  # Seen from within, an input drives.
  dict set ::ports $name [list [string map {I O O I} [dict get $given -dir]] data $width]
  return $name
}

# Every net by its driver, the sinks of each by name.
proc connect_bd_net {first second} {
  lassign [fact_of $first] direction kind width
  lassign [fact_of $second] other_direction other_kind other_width
  if {$direction eq $other_direction} { wrong "$first and $second both have direction $direction" }
  if {$direction eq "I"} {
    lassign [list $second $first] first second
    lassign [list $other_kind $other_width $kind $width] kind width other_kind other_width
  }
  if {$width ne $other_width && ![legal $width $other_width]} {
    wrong "$first has $width bits, $second has $other_width"
  }
  if {$kind ne [string trimright $other_kind ?]} { wrong "$first is a $kind, $second a $other_kind" }
  if {[dict exists $::nets $second]} { wrong "$second is driven by [dict get $::nets $second] already" }
  dict set ::nets $second $first
}

# Vivado finds AXI4-Lite by the names of a module's ports: UG994.
proc is_module_bus {path} {
  lassign [split $path /] cell name
  expr {[dict exists $::cells $cell entity] && [dict exists $::entities [dict get $::cells $cell entity] ${name}_awaddr]}
}
proc is_module_stream {path} {
  lassign [split $path /] cell name
  expr {[dict exists $::cells $cell entity] && [dict exists $::entities [dict get $::cells $cell entity] ${name}_tvalid]}
}
proc get_bd_intf_pins {path} {
  lassign [split $path /] cell name
  if {[is_module_bus $path]} { return $path }
  set ip [dict get $::cells [get_bd_cells $cell] ip]
  if {![dict exists $::catalog $ip interface $name]} { wrong "$ip has no interface $name" }
  if {![valued $cell [lindex [dict get $::catalog $ip interface $name] 1]]} {
    wrong "$path is not there, as the properties are"
  }
  return $path
}
proc mode_of {path} {
  lassign [split $path /] cell name
  if {[is_module_bus $path]} { return slave }
  lindex [dict get $::catalog [dict get $::cells $cell ip] interface $name] 0
}
proc connect_bd_intf_net {first second} {
  if {[mode_of $first] eq [mode_of $second]} { wrong "$first and $second are both of mode [mode_of $first]" }
  foreach {one other} [list $first $second $second $first] {
    if {[dict exists $::links $one]} { wrong "$one is connected to [dict get $::links $one] already" }
    dict set ::links $one $other
  }
}

# --- addresses -------------------------------------------------------------------------------------------------------

set assigned {}
proc get_bd_addr_spaces {path} { address space $path }
proc get_bd_addr_segs {path} { address segment $path }
proc address {what path} {
  regexp {^(\w+)/(.*)$} $path all cell name
  if {$what eq "segment" && $name eq "s_axi/reg0" && [is_module_bus $cell/s_axi]} { return $path }
  if {![dict exists $::catalog [dict get $::cells [get_bd_cells $cell] ip] $what $name]} {
    wrong "there is no $what $path"
  }
  return $path
}
proc assign_bd_address {args} {
  lassign [options {-force} {-offset -range -target_address_space} $args] given segment
  if {$segment eq ""} {
    lappend ::assigned rest
  } else {
    # What goes to the masters that are used here: the maps of addresses in UG585 and UG1085.
    set windows {processing_system7 {0x40000000 .. 0x7FFFFFFF} zynq_ultra_ps_e {0xA0000000 .. 0xAFFFFFFF}}
    set cell [lindex [split [dict get $given -target_address_space] /] 0]
    set window [dict get $windows [dict get $::cells $cell ip]]
    if {![legal [dict get $given -offset] $window]} { wrong "[dict get $given -offset] is not within $window" }
    lappend ::assigned $segment
  }
}

# --- the end ---------------------------------------------------------------------------------------------------------

proc validate_bd_design {} {
  dict for {cell fact} $::cells {
    if {[dict exists $fact entity]} { validate_module $cell } else { validate_ip $cell }
  }
  dict for {port fact} $::ports {
    if {![is_connected $port]} { wrong "port $port leads nowhere" }
  }
  if {"rest" ni $::assigned} { wrong "not all addresses are assigned" }
  dict set ::project validated 1
}
proc is_connected {pin} { expr {[dict exists $::nets $pin] || $pin in [dict values $::nets]} }
set associated {}
proc validate_module {cell} {
  foreach port [dict keys [dict get $::entities [dict get $::cells $cell entity]]] {
    if {[regexp {^(.*)_(?:tvalid|awaddr)$} $port all bus] && "$cell/$bus" ni $::associated} {
      wrong "BD 41-967: AXI interface pin $cell/$bus is not associated to any clock pin"
    }
  }
  dict for {name fact} [dict get $::entities [dict get $::cells $cell entity]] {
    if {[regexp {^(s_axi)_} $name all bus] && [dict exists $::links $cell/$bus]} continue
    if {[lindex $fact 0] eq "I" && ![lindex $fact 2] && ![dict exists $::nets $cell/$name]} { wrong "input $cell/$name is not connected" }
  }
}
proc validate_ip {cell} {
  set facts [dict get $::catalog [dict get $::cells $cell ip]]
  dict for {condition one} [dict get $facts rule] {
    if {![valued $cell $condition]} { wrong "$cell breaks the rule $condition" }
  }
  dict for {name fact} [dict get $facts pin] {
    lassign $fact direction kind width condition
    if {$direction eq "I" && $kind in {clock reset_n} && [valued $cell $condition] && ![is_connected $cell/$name]} {
      wrong "$kind $cell/$name is not connected"
    }
  }
  dict for {name fact} [dict get $facts interface] {
    if {[valued $cell [lindex $fact 1]] && ![dict exists $::links $cell/$name]} { wrong "$cell/$name is not connected" }
  }
  if {[dict get $facts automation] ne "" && ![dict exists $::cells $cell automated]} { wrong "$cell has no preset" }
  dict for {name one} [dict get $facts segment] {
    if {"$cell/$name" ni $::assigned} { wrong "$cell/$name has no address" }
  }
}
proc save_bd_design {} {
  if {![dict exists $::project validated]} { wrong "the design is not validated" }
  dict set ::project saved 1
}
proc make_wrapper {args} {
  lassign [options {-import -top} {-files} $args] given
  if {![dict exists $::project saved] || ![dict exists $::project generated [dict get $given -files]]} {
    wrong "the design is not saved, or its files are not generated"
  }
  dict set ::entities [string tolower ${::design}_wrapper] {}
}

# --- constraints, read when the design is there: UG903 ----------------------------------------------------------------

set timing {}
proc get_clocks {name} {
  set forms {processing_system7 {clk_fpga_%d FCLK_CLK%d} zynq_ultra_ps_e {clk_pl_%d pl_clk%d}}
  dict for {cell fact} $::cells {
    if {![dict exists $fact ip] || ![dict exists $forms [dict get $fact ip]]} continue
    lassign [dict get $forms [dict get $fact ip]] clock pin
    for {set number 0} {$number < 4} {incr number} {
      if {$name eq [format $clock $number] && "$cell/[format $pin $number]" in [dict values $::nets]} { return $name }
    }
  }
  wrong "there is no clock $name"
}
proc get_pins {args} {
  lassign [options {-hierarchical} {-filter} $args] given
  if {![regexp {^NAME =~ \*/(u_\w+)/(?:\*_r|first_r)_reg\*/(?:CLR|D)$} [dict get $given -filter] all label]} {
    wrong "get_pins $args"
  }
  instances $label
  return [string range [lindex [dict get $given -filter] 2] 2 end]
}
proc get_cells {args} {
  lassign [options {-hierarchical -quiet} {-filter} $args] given
  set filter [dict get $given -filter]
  if {![regexp {^NAME =~ \*/(u_\w+)(?:/(u_\w+))?/(?:\w+_reg\*|\* && IS_SEQUENTIAL)$} $filter all label inner]} {
    wrong "get_cells $args"
  }
  set name [string range [lindex $filter 2] 2 end]
  if {[dict exists $given -quiet] && $name eq $::finds} { return {} }
  instances [concat $label $inner]
  return $name
}
proc set_max_delay {args} {
  lassign [options {-datapath_only} {-from -to} $args] given delay
  if {![dict exists $given -datapath_only]} { wrong "set_max_delay without -datapath_only" }
  note_delay max_delay $given $delay
}
proc set_bus_skew {args} {
  lassign [options {} {-from -to} $args] given delay
  note_delay bus_skew $given $delay
}
proc note_delay {what given delay} {
  if {![string is double -strict $delay]} { wrong "the delay is $delay" }
  set sink [expr {[dict exists $given -to] ? [dict get $given -to] : ""}]
  lappend ::timing [concat $what [dict get $given -from] $sink $delay]
}
proc set_false_path {args} {
  lassign [options {} {-to} $args] given
  lappend ::timing "false_path [dict get $given -to]"
}

# --- the routed design: UG835, and UG912 for the properties of paths ---------------------------------------------------

proc get_timing_paths {args} {
  lassign [options {-quiet} {-delay_type -slack_lesser_than -max_paths -from -to} $args] given
  if {[dict exists $given -from]} {
    return [expr {$::finds eq "path" ? "path_other" : "path_crossing"}]
  }
  if {[dict get $given -delay_type] ni {max min min_max}} { wrong "get_timing_paths $args" }
  expr {$::finds eq [dict get $given -delay_type] ? "path_late" : {}}
}
proc property_of_path {name path} {
  if {$name ni {SLACK STARTPOINT_PIN ENDPOINT_PIN EXCEPTION}} { wrong "unknown property $name of a path" }
  dict get [dict create SLACK -0.123 STARTPOINT_PIN from/C ENDPOINT_PIN to/D EXCEPTION [
    expr {$path eq "path_crossing" ? "MaxDelay Path 5.000ns -datapath_only" : ""}
  ]] $name
}
proc report_bus_skew {args} {
  lassign [options {-quiet -return_string} {} $args] given
  if {![dict exists $given -return_string]} { wrong "report_bus_skew $args" }
  return "Slack ([expr {$::finds eq {skew} ? {VIOLATED} : {MET}}]) :"
}
proc report_cdc {args} {
  lassign [options {-quiet -details} {-file} $args] given
  lappend ::timing "cdc [dict get $given -file]"
}

or_leave {
  source [lindex $argv 0]
  foreach name {part top validated} {
    if {![dict exists $project $name]} { wrong "the project has no $name" }
  }
  if {![dict exists $project source_mgmt_mode] || [dict get $project source_mgmt_mode] ne "All"} {
    wrong "Vivado has to manage the sources, so that a module is found by its name"
  }
  if {![dict exists $entities [string tolower [dict get $project top]]]} {
    wrong "there is no top level [dict get $project top]"
  }
  check_instances
  foreach name $constraints { source $name }
  source [dict get $project STEPS.ROUTE_DESIGN.TCL.POST]
}
dict for {cell fact} $cells { puts "cell $cell [dict get $fact [lindex [dict keys $fact] 0]]" }
dict for {sink driver} $nets { puts "net $driver $sink [lindex [fact_of $driver] 2]" }
dict for {port fact} $ports { puts "port $port [lindex $fact 2]" }
foreach line $timing { puts $line }
foreach kernel $kernels { puts "kernel [lindex $kernel 0]" }
