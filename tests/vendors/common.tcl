# What the scripts of vendors' tools are checked with, whichever tool they are for; `source` has become `run_script` and
# so on, so that a tool's own commands can have these names.

rename source run_script
rename exec run_program
rename exit leave

# Raises an error that names what is wrong.
proc wrong {args} { return -code error [join $args] }

# The values of options in a command's arguments, and what remains; `flags` stand alone.
proc options {flags valued arguments} {
  set found {}
  set rest {}
  for {set index 0} {$index < [llength $arguments]} {incr index} {
    set word [lindex $arguments $index]
    if {$word in $flags} {
      dict set found $word 1
    } elseif {$word in $valued} {
      dict set found $word [lindex $arguments [incr index]]
    } elseif {[string match {-[a-z]*} $word]} {
      wrong "unknown option $word of [lindex [info level -1] 0]"
    } else {
      lappend rest $word
    }
  }
  list $found $rest
}

proc legal {value values} {
  if {[lindex $values 1] eq ".."} {
    return [expr {[string is double -strict $value] && $value >= [lindex $values 0] && $value <= [lindex $values 2]}]
  }
  expr {$value in $values}
}

# --- sources ---------------------------------------------------------------------------------------------------------

# Ports by entity, each with direction (I or O), bits where these are numbers, and whether it has a default; and what other entities instantiate.
set entities {}
set instantiated {}
set labels {}
proc existing {name} {
  if {![file isfile $name]} { wrong "there is no file $name" }
  return $name
}

proc read_vhdl {args} {
  lassign [options {-vhdl2008} {-library} $args] given names
  foreach name $names {
    set channel [open [existing $name]]
    set text [regsub -all -line -- {--.*$} [read $channel] ""]
    close $channel
    foreach {all label} [regexp -all -inline -nocase {(\w+)\s*:\s*(?:entity\s+(?:work|firm)\.|component\s)} $text] {
      dict set ::labels [string tolower $label] 1
    }
    foreach {all name} [regexp -all -inline -nocase {:\s*entity\s+(?:work|firm)\.(\w+)} $text] {
      dict set ::instantiated [string tolower $name] 1
    }
    while {[regexp -indices -nocase {\mentity\s+(\w+)\s+is\M} $text all place]} {
      set entity [string tolower [string range $text {*}$place]]
      set text [string range $text [lindex $all 1] end]
      # A declaration has no other `end` than its own.
      regexp -indices -nocase {\mend\M} $text end
      set declaration [string range $text 0 [lindex $end 0]-1]
      dict set ::entities $entity {}
      if {[regexp -nocase {\mport\s*\((.*)\)\s*;\s*$} $declaration all ports]} {
        dict set ::entities $entity [ports_of $ports]
      }
    }
  }
}
proc ports_of {text} {
  set found {}
  foreach declaration [split $text ";"] {
    set form {^\s*([\w\s,]+?)\s*:\s*(in|out)\s+std_logic(?:_vector\s*\(\s*(\d+)\s+downto\s+0\s*\))?}
    if {![regexp -nocase $form $declaration all names direction high]} continue
    foreach name [split $names ","] {
      set width [expr {$high eq "" ? 1 : $high + 1}]
      set has_default [regexp {:=} $declaration]
      dict set found [string tolower [string trim $name]] [list [expr {$direction eq "in" ? "I" : "O"}] $width $has_default]
    }
  }
  return $found
}
# The instances in the name of a register, from `all` parts of it.
proc instances {parts} {
  foreach part $parts {
    if {![dict exists $::labels [string tolower $part]]} { wrong "there is no instance $part" }
  }
}
proc source {name} { uplevel #0 [list run_script [existing $name]] }
proc check_instances {} {
  dict for {name one} $::instantiated {
    if {![dict exists $::entities $name]} { wrong "there is no entity $name" }
  }
}

# Runs `body`; if it fails, says why and leaves.
proc or_leave {body} {
  if {[catch { uplevel #0 $body } message]} {
    puts stderr $message
    leave 1
  }
}
