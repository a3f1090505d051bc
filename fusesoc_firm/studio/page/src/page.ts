import { mount } from "svelte";
import App from "./App.svelte";

export const show = () => mount(App, { target: document.getElementById("app")! });
