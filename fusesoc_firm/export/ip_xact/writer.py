"""A component as the XML of IP-XACT, in three versions of the standard.

The element trees of IEEE 1685-2014 and 1685-2022 are almost the same; that of 1685-2009 is flatter, and has the vendor
extensions and the parameters' ids that Vivado's packager writes.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element, SubElement

from fusesoc_firm.export.component.model import BusInterface, Component, Direction, Generic, Port, SourceFile
from fusesoc_firm.system.hardware.registers import Field, Kind, Register

_XILINX = "http://www.xilinx.com"
_COMMON_TYPES = (
    "vhdlSource vhdlSource-87 vhdlSource-93 verilogSource verilogSource-95 verilogSource-2001 systemVerilogSource"
)
_LATER_TYPES = (
    "vhdlSource-2002 vhdlSource-2008 verilogSource-2005 "
    "systemVerilogSource-2009 systemVerilogSource-2012 systemVerilogSource-2017"
)


@dataclass(frozen=True)
class Standard:
    """A version of the standard: its namespace, its words, and the types of files that it knows.

    In a version that `is_flat`, an interface has one abstraction, a model its files and parameters, and a register its
    reset. In one that `has_policies`, the access of a field is a policy, and the description follows the names.
    """

    year: int
    prefix: str
    namespace: str
    is_flat: bool
    has_policies: bool
    initiator: str
    target: str
    file_types: tuple[str, ...]


STANDARDS = {
    item.year: item
    for item in (
        Standard(
            2009,
            "spirit",
            "http://www.spiritconsortium.org/XMLSchema/SPIRIT/1685-2009",
            is_flat=True,
            has_policies=False,
            initiator="master",
            target="slave",
            file_types=tuple(_COMMON_TYPES.split()),
        ),
        Standard(
            2014,
            "ipxact",
            "http://www.accellera.org/XMLSchema/IPXACT/1685-2014",
            is_flat=False,
            has_policies=False,
            initiator="master",
            target="slave",
            file_types=tuple(_COMMON_TYPES.split()),
        ),
        Standard(
            2022,
            "ipxact",
            "http://www.accellera.org/XMLSchema/IPXACT/1685-2022",
            is_flat=False,
            has_policies=True,
            initiator="initiator",
            target="target",
            file_types=tuple(f"{_COMMON_TYPES} {_LATER_TYPES}".split()),
        ),
    )
}


@dataclass(frozen=True)
class _View:
    """A view of the component, with its set of files."""

    name: str
    title: str
    environment: str

    @property
    def files(self) -> str:
        return f"{self.name}_view_fileset"


@dataclass(frozen=True)
class _Parameter:
    """A parameter with its id, and with the instance that determines its value, if it is not the packager."""

    name: str
    value: float | str
    id: str
    resolve: str = ""


# The names are those of Vivado's packager; other tools accept any.
_VIEWS = (
    _View("xilinx_anylanguagesynthesis", "Synthesis", ":vivado.xilinx.com:synthesis"),
    _View("xilinx_anylanguagebehavioralsimulation", "Simulation", ":vivado.xilinx.com:simulation"),
)
_GUI = _View("xilinx_xpgui", "UI Layout", ":vivado.xilinx.com:xgui.ui")
_FAMILIES = (
    "spartan7 artix7 artix7l kintex7 kintex7l virtex7 zynq kintexu virtexu artixuplus kintexuplus virtexuplus "
    "virtexuplusHBM zynquplus versal"
)
_FORMATS = {bool: "bool", int: "long", float: "float", str: "string"}
# In 1685-2014 and later.
_TYPES = {bool: "bit", int: "int", float: "real", str: "string"}


def vlnv(component: Component, standard: Standard) -> tuple[str, str, str, str]:
    """Return vendor, library, name and version, which has only two numbers for Vivado."""
    version = _vivado_version(component.version)[0] if standard.is_flat else component.version
    return component.vendor, component.library, component.name, version


def gui_path(component: Component) -> str:
    """Return the path of the Tcl file in which Vivado finds the layout of a component's parameters."""
    return f"xgui/{instance_name(component)}.tcl"


def instance_name(component: Component) -> str:
    """Return the name that Vivado proposes for an instance."""
    return f"{component.name}_v{'_'.join(_vivado_version(component.version)[0].split('.'))}"


def write_component(component: Component, standard: Standard) -> str:
    """Return the content of `component.xml`."""
    return _Writer(component, standard).text()


class _Writer:
    def __init__(self, component: Component, standard: Standard) -> None:
        self._component = component
        self._standard = standard

    def text(self) -> str:
        ET.register_namespace(self._standard.prefix, self._standard.namespace)
        ET.register_namespace("xilinx", _XILINX)
        root = self._root()
        ET.indent(root)
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'

    def _root(self) -> Element:
        component = self._component
        root = Element(self._name("component"))
        for name, text in zip(("vendor", "library", "name", "version"), vlnv(component, self._standard), strict=True):
            self._add(root, name, text)
        if self._standard.has_policies:
            self._describe(root)
        self._interfaces(root)
        self._address_spaces(root)
        self._memory_maps(root)
        self._model(root)
        self._file_sets(root)
        if not self._standard.has_policies:
            self._describe(root)
        self._parameters_of_component(root)
        if self._standard.is_flat:
            self._extensions(root)
        return root

    def _describe(self, root: Element) -> None:
        if self._component.description:
            self._add(root, "description", self._component.description)

    # Elements.

    def _name(self, name: str) -> str:
        return f"{{{self._standard.namespace}}}{name}"

    def _add(self, parent: Element, name: str, text: str | int | None = None, /, **attributes: str) -> Element:
        """Add an element; in 1685-2009, attributes have the prefix, too."""
        qualified = {self._name(word) if self._standard.is_flat else word: value for word, value in attributes.items()}
        element = SubElement(parent, self._name(name), qualified)
        if text is not None:
            element.text = str(text)
        return element

    def _parameter(self, group: Element, kind: str, parameter: _Parameter) -> None:
        value = parameter.value
        how = {"resolve": parameter.resolve} if parameter.resolve else {}
        if self._standard.is_flat:
            item = self._add(group, kind)
            self._add(item, "name", parameter.name)
            form = {} if isinstance(value, str) else {"format": _FORMATS[type(value)]}
            text = str(value).lower() if isinstance(value, bool) else str(value)
            self._add(item, "value", text, **form, **how, id=parameter.id)
        else:
            item = self._add(group, kind, parameterId=parameter.id, type=_TYPES[type(value)], **how)
            self._add(item, "name", parameter.name)
            self._add(item, "value", _expression(value))

    # Interfaces and their addresses.

    def _interfaces(self, root: Element) -> None:
        if not self._component.interfaces:
            return
        group = self._add(root, "busInterfaces")
        for interface in self._component.interfaces:
            item = self._add(group, "busInterface")
            self._add(item, "name", interface.name)
            library, name = interface.bus.value
            self._add(item, "busType", vendor="xilinx.com", library=library, name=name, version="1.0")
            abstraction = {"vendor": "xilinx.com", "library": library, "name": f"{name}_rtl", "version": "1.0"}
            if self._standard.is_flat:
                self._add(item, "abstractionType", **abstraction)
                self._mode(item, interface)
                self._port_maps(item, interface)
            else:
                kind = self._add(self._add(item, "abstractionTypes"), "abstractionType")
                self._add(kind, "abstractionRef", **abstraction)
                self._port_maps(kind, interface)
                self._mode(item, interface)
            parameters = self._add(item, "parameters") if interface.parameters else item
            for name, value in interface.parameters.items():
                id_ = f"BUSIFPARAM_VALUE.{interface.name.upper()}.{name}"
                self._parameter(parameters, "parameter", _Parameter(name, value, id_))

    def _mode(self, item: Element, interface: BusInterface) -> None:
        mode = self._add(item, self._standard.initiator if interface.is_initiator else self._standard.target)
        if interface.addresses:
            what = "addressSpaceRef" if interface.is_initiator else "memoryMapRef"
            self._add(mode, what, **{what: interface.name})

    def _port_maps(self, item: Element, interface: BusInterface) -> None:
        group = self._add(item, "portMaps")
        for logical, physical in interface.ports.items():
            pair = self._add(group, "portMap")
            self._add(self._add(pair, "logicalPort"), "name", logical)
            self._add(self._add(pair, "physicalPort"), "name", physical)

    def _address_spaces(self, root: Element) -> None:
        masters = [item for item in self._component.interfaces if item.addresses and item.is_initiator]
        group = self._add(root, "addressSpaces") if masters else root
        for interface in masters:
            space = self._add(group, "addressSpace")
            self._add(space, "name", interface.name)
            assert interface.addresses
            self._add(space, "range", interface.addresses.size)
            self._add(space, "width", interface.addresses.width)

    def _memory_maps(self, root: Element) -> None:
        slaves = [item for item in self._component.interfaces if item.addresses and not item.is_initiator]
        group = self._add(root, "memoryMaps") if slaves else root
        for interface in slaves:
            addresses = interface.addresses
            assert addresses
            memory = self._add(group, "memoryMap")
            self._add(memory, "name", interface.name)
            block = self._add(memory, "addressBlock")
            self._add(block, "name", "registers")
            for name, value in (("baseAddress", 0), ("range", addresses.size), ("width", addresses.width)):
                self._add(block, name, value)
            self._add(block, "usage", "register")
            for register in addresses.registers:
                self._register(block, register, addresses.width)
            self._add(memory, "addressUnitBits", 8)

    def _register(self, block: Element, register: Register, width: int) -> None:
        item = self._add(block, "register")
        self._add(item, "name", _identifier(register.name))
        self._add(item, "description", register.title)
        self._add(item, "addressOffset", self._hexadecimal(register.address))
        self._add(item, "size", width)
        if self._standard.is_flat:
            known = [field for field in register.fields if field.has_reset]
            if known:
                reset = self._add(item, "reset")
                mask = sum(((1 << field.width) - 1) << field.low for field in known)
                self._add(reset, "value", self._hexadecimal(sum(field.reset << field.low for field in known)))
                self._add(reset, "mask", self._hexadecimal(mask))
        for field in register.fields:
            self._field(item, field)

    def _field(self, register: Element, field: Field) -> None:
        item = self._add(register, "field")
        self._add(item, "name", field.name)
        self._add(item, "bitOffset", field.low)
        volatile = str(field.kind in (Kind.VALUE, Kind.COUNTER, Kind.STICKY)).lower()
        access = "read-write" if field.is_writable else "read-only"
        clearing = field.kind is Kind.STICKY
        if self._standard.has_policies:
            self._add(item, "bitWidth", field.width)
            self._add(item, "volatile", volatile)
            self._reset(item, field)
            policy = self._add(self._add(item, "fieldAccessPolicies"), "fieldAccessPolicy")
        else:
            if not self._standard.is_flat:
                self._reset(item, field)
            self._add(item, "bitWidth", field.width)
            self._add(item, "volatile", volatile)
            policy = item
        self._add(policy, "access", access)
        if clearing:
            self._add(policy, "modifiedWriteValue", "oneToClear")

    def _reset(self, item: Element, field: Field) -> None:
        if field.has_reset:
            self._add(self._add(self._add(item, "resets"), "reset"), "value", self._hexadecimal(field.reset))

    def _hexadecimal(self, value: int) -> str:
        return f"0x{value:X}" if self._standard.is_flat else f"'h{value:X}"

    # The model.

    def _model(self, root: Element) -> None:
        model = self._add(root, "model")
        views = self._add(model, "views")
        for view in _VIEWS:
            item = self._view(views, view)
            if self._standard.is_flat:
                self._add(item, "language", self._component.language)
                self._add(item, "modelName", self._component.name)
                self._add(self._add(item, "fileSetRef"), "localName", view.files)
            else:
                self._add(item, "componentInstantiationRef", f"{view.name}_instantiation")
        if self._standard.is_flat:
            gui = self._view(views, _GUI)
            self._add(self._add(gui, "fileSetRef"), "localName", _GUI.files)
        else:
            self._instantiations(model)
        ports = self._add(model, "ports")
        for port in self._component.ports:
            self._port(ports, port)
        if self._standard.is_flat and self._component.generics:
            group = self._add(model, "modelParameters")
            for generic in self._component.generics:
                resolve = "generated" if generic.is_free else "immediate"
                parameter = _Parameter(generic.name, generic.value, f"MODELPARAM_VALUE.{generic.name}", resolve)
                self._parameter(group, "modelParameter", parameter)

    def _view(self, views: Element, view: _View) -> Element:
        item = self._add(views, "view")
        self._add(item, "name", view.name)
        self._add(item, "displayName", view.title)
        self._add(item, "envIdentifier", view.environment)
        return item

    def _instantiations(self, model: Element) -> None:
        group = self._add(model, "instantiations")
        for view in _VIEWS:
            item = self._add(group, "componentInstantiation")
            self._add(item, "name", f"{view.name}_instantiation")
            self._add(item, "language", self._component.language)
            self._add(item, "moduleName", self._component.name)
            if self._component.generics:
                parameters = self._add(item, "moduleParameters")
                for generic in self._component.generics:
                    module = self._add(parameters, "moduleParameter", type=_TYPES[type(generic.value)])
                    self._add(module, "name", generic.name)
                    self._add(
                        module, "value", _parameter_id(generic) if generic.is_free else _expression(generic.value)
                    )
            self._add(self._add(item, "fileSetRef"), "localName", view.files)

    def _port(self, ports: Element, port: Port) -> None:
        item = self._add(ports, "port")
        self._add(item, "name", port.name)
        wire = self._add(item, "wire")
        self._add(wire, "direction", port.direction.value)
        if port.bounds:
            vector = self._add(wire if self._standard.is_flat else self._add(wire, "vectors"), "vector")
            form = {"format": "long"} if self._standard.is_flat else {}
            for side, bound in zip(("left", "right"), port.bounds, strict=True):
                self._add(vector, side, bound, **form)
        kind = self._add(self._add(wire, "wireTypeDefs"), "wireTypeDef")
        is_vhdl = self._component.language == "VHDL"
        self._add(kind, "typeName", ("std_logic_vector" if port.bounds else "std_logic") if is_vhdl else "wire")
        for view in _VIEWS:
            self._add(kind, "viewNameRef" if self._standard.is_flat else "viewRef", view.name)
        if port.default is not None and port.direction is Direction.IN:
            driver = self._add(wire if self._standard.is_flat else self._add(wire, "drivers"), "driver")
            self._add(driver, "defaultValue", port.default)

    # Files.

    def _file_sets(self, root: Element) -> None:
        group = self._add(root, "fileSets")
        for view in _VIEWS:
            files = self._add(group, "fileSet")
            self._add(files, "name", view.files)
            for file in self._component.files:
                self._file(files, file)
        if self._standard.is_flat:
            files = self._add(group, "fileSet")
            self._add(files, "name", _GUI.files)
            item = self._add(files, "file")
            self._add(item, "name", gui_path(self._component))
            self._add(item, "fileType", "tclSource")
            self._add(item, "userFileType", "XGUI_VERSION_2")

    def _file(self, files: Element, file: SourceFile) -> None:
        item = self._add(files, "file")
        self._add(item, "name", str(file.path))
        type_ = self._file_type(file.type)
        if type_ in self._standard.file_types:
            self._add(item, "fileType", type_)
        elif self._standard.is_flat:
            self._add(item, "userFileType", type_)
        else:
            self._add(item, "fileType", "user", user=type_)
        if file.is_include_file:
            self._add(item, "isIncludeFile", "true")
        if file.library:
            self._add(item, "logicalName", file.library)

    def _file_type(self, type_: str) -> str:
        """Return the type in the standard's words; Vivado's name of VHDL-93, and of Verilog, has no year."""
        is_plain = type_ == "vhdlSource-93" or type_.startswith("verilogSource")
        return type_.partition("-")[0] if self._standard.is_flat and is_plain else type_

    # What only Vivado reads.

    def _parameters_of_component(self, root: Element) -> None:
        free = [generic for generic in self._component.generics if generic.is_free]
        if not free and not self._standard.is_flat:
            return
        group = self._add(root, "parameters")
        for generic in free:
            id_ = f"PARAM_VALUE.{generic.name}" if self._standard.is_flat else _parameter_id(generic)
            self._parameter(group, "parameter", _Parameter(generic.name, generic.value, id_, "user"))
        if self._standard.is_flat:
            name = "Component_Name"
            instance = _Parameter(name, instance_name(self._component), f"PARAM_VALUE.{name}", "user")
            self._parameter(group, "parameter", instance)

    def _extensions(self, root: Element) -> None:
        core = SubElement(self._add(root, "vendorExtensions"), f"{{{_XILINX}}}coreExtensions")
        families = SubElement(core, f"{{{_XILINX}}}supportedFamilies")
        for name in _FAMILIES.split():
            family = SubElement(families, f"{{{_XILINX}}}family", {f"{{{_XILINX}}}lifeCycle": "Production"})
            family.text = name
        SubElement(SubElement(core, f"{{{_XILINX}}}taxonomies"), f"{{{_XILINX}}}taxonomy").text = "/UserIP"
        SubElement(core, f"{{{_XILINX}}}displayName").text = self._component.name
        SubElement(core, f"{{{_XILINX}}}definitionSource").text = "package_project"
        SubElement(core, f"{{{_XILINX}}}coreRevision").text = _vivado_version(self._component.version)[1]


def _vivado_version(version: str) -> tuple[str, str]:
    """Return a version of two numbers, which is all that Vivado accepts, and the revision."""
    numbers = [*(part for part in version.partition("-")[0].split(".") if part.isdecimal()), *"000"]
    return ".".join(numbers[:2]), numbers[2]


def _identifier(name: str) -> str:
    """Return the name of a register without brackets and dots."""
    return name.replace("[", "_").replace("]", "").replace(".", "_")


def _parameter_id(generic: Generic) -> str:
    return f"PARAM_{generic.name}"


def _expression(value: float | str) -> str:
    """Return a value as an expression of SystemVerilog, the language of expressions since 1685-2014."""
    if isinstance(value, str):
        return f'"{value}"'
    return str(int(value)) if isinstance(value, bool) else str(value)
