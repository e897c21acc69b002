/**
 * The crate, compiled to WebAssembly: from the text in the page to a module that runs here and in
 * workers.
 */
import init from "../pkg/axlewire_web.js";

export { Bus, Listener, Rover, guess } from "../pkg/axlewire_web.js";

async function compile(): Promise<WebAssembly.Module> {
  const text = document.getElementById("wasm")?.textContent ?? "";
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(unpacked).arrayBuffer());
}

async function start(): Promise<WebAssembly.Module> {
  const module = await compile();
  await init({ module_or_path: module });
  return module;
}

/** Resolves when the classes above can be used. Workers are given the module. */
export const ready: Promise<WebAssembly.Module> = start();
