// The engine starts its worker before the page itself is loaded.
import "./engine";
import "@xyflow/svelte/dist/style.css";
import "./style.css";

import("./page").then(({ show }) => show());
