// Speech: push to talk, words that are shown before they act, and answers that are read aloud.

import { find, make, setText } from "./dom.js";

const RATE = 16000; // samples a second that the server hears
const LONGEST = 15000; // milliseconds of a spoken sentence
const DELAY = 3000; // milliseconds in which words can be taken back
const AT_ONCE = /^(stop|wait|no|no wait|halt|never mind)$/i; // a robot is never stopped too late
const Recogniser = window.SpeechRecognition ?? window.webkitSpeechRecognition;
const TOLD = "deixis-speech-told";
const WHERE = "This browser sends what you say to its vendor, which turns it into words. Lab, Speech can change that. Press again to talk.";
const FAILURES = { // of the browser's recogniser and of the microphone
  "not-allowed": "The microphone is not allowed: allow it for this page in the browser.",
  NotAllowedError: "The microphone is not allowed: allow it for this page in the browser.",
  "audio-capture": "There is no microphone.",
  NotFoundError: "There is no microphone.",
  NotReadableError: "The microphone is in use by another program.",
  "no-speech": "Nothing was heard: speak nearer to the microphone, or louder.",
};

/** box: where words are shown. send: sends a message of this tab. */
export class Speech {
  constructor(box, send) {
    Object.assign(this, { box, send, installed: false, missing: "", failed: false, stopRecording: null, timer: null });
    this.button = find("talk");
    this.button.addEventListener("click", () => this.toggle());
    addEventListener("keydown", (event) => this.key(event));
    box.input.addEventListener("input", () => this.typed());
    box.input.addEventListener("pointerdown", () => this.keep());
    find("form").addEventListener("submit", () => this.keep());
    find("stop").addEventListener("click", () => this.cancel());
  }

  // ---- What there is

  /** Show what the server can hear. */
  show({ installed, note }) {
    this.installed = installed;
    this.missing = note;
    this.onChange();
  }

  onChange() {
    for (const option of this.source?.options ?? []) option.disabled = option.value === "server" ? !this.installed : !Recogniser;
    if (this.source) this.source.value = this.by;
  }

  /** Who hears: the browser, the server or nobody. */
  get by() {
    const chosen = this.chosen ?? (this.failed || !Recogniser ? "server" : "browser");
    if (chosen === "server" && !this.installed) return Recogniser && !this.failed ? "browser" : "nobody";
    return chosen;
  }

  /** The part of the Lab. */
  build() {
    this.source = make("select", { onchange: () => { this.chosen = this.source.value; } },
      make("option", { value: "browser" }, "the browser, by its vendor"),
      make("option", { value: "server" }, "where play.py runs, offline"),
      make("option", { value: "nobody" }, "nobody"));
    this.acts = make("input", { type: "checkbox", checked: true });
    this.aloud = make("input", { type: "checkbox", disabled: !window.speechSynthesis });
    this.aloud.addEventListener("change", () => window.speechSynthesis?.cancel());
    this.onChange();
    return make("details", {}, make("summary", {}, "Speech"),
      make("label", { className: "row" }, "Who hears", this.source),
      make("label", {}, this.acts, ` Do what was heard after ${DELAY / 1000} seconds`),
      make("label", {}, this.aloud, " Read answers aloud"));
  }

  // ---- Push to talk

  key(event) {
    if (event.key === "Escape" && (this.timer || this.stopRecording)) this.cancel();
    if (this.button.offsetParent === null || event.key.toLowerCase() !== "m" || !event.ctrlKey || event.altKey || event.metaKey || event.repeat) return;
    event.preventDefault();
    this.toggle();
  }

  toggle() {
    if (this.stopRecording) {
      this.stopRecording(true);
      return;
    }
    this.keep();
    window.speechSynthesis?.cancel(); // else the robot hears itself
    if (this.by === "nobody") this.note(this.missing || "Nobody hears: choose who in Lab, Speech.");
    else if (this.by === "browser") this.hearInBrowser();
    else this.record();
  }

  listening(stop) {
    this.stopRecording = stop;
    this.button.setAttribute("aria-pressed", Boolean(stop));
    if (stop) this.note("Listening: press again when you have said it; Escape takes it back.");
  }

  hearInBrowser() {
    if (!localStorage.getItem(TOLD)) {
      localStorage.setItem(TOLD, "yes");
      this.note(WHERE);
      return;
    }
    const recogniser = new Recogniser();
    let taken = true;
    recogniser.lang = "en-US";
    recogniser.interimResults = true;
    recogniser.onresult = (event) => {
      if (!taken) return;
      const results = [...event.results];
      this.box.input.value = results.map((result) => result[0].transcript).join(" ").trim();
      if (results.every((result) => result.isFinal)) this.heard({ words: this.box.input.value, note: "" });
    };
    recogniser.onerror = ({ error }) => {
      if (error === "aborted") return;
      if (!(error in FAILURES)) this.failed = true; // it has no service: the server hears from now on, where it can
      const next = this.by === "server" ? "Press again: now it is heard where play.py runs, offline." : this.missing;
      this.note(FAILURES[error] ?? `The browser's recogniser does not answer. ${next}`);
      this.onChange();
    };
    recogniser.onend = () => this.listening(null);
    this.listening((keeps) => {
      taken = keeps;
      if (keeps) recogniser.stop();
      else recogniser.abort();
    });
    recogniser.start();
  }

  async record() {
    let stream;
    try {
      if (!navigator.mediaDevices) throw new DOMException("", "insecure");
      this.button.disabled = true;
      stream = await navigator.mediaDevices.getUserMedia({ audio: { channelCount: 1, echoCancellation: false } });
    } catch (error) {
      const insecure = "The microphone needs https, or a page that is opened on the machine itself.";
      this.note(error.name === "insecure" ? insecure : FAILURES[error.name] ?? "The microphone does not work.");
      return;
    } finally {
      this.button.disabled = false;
    }
    const context = new AudioContext({ sampleRate: RATE });
    const pieces = [];
    try {
      await context.audioWorklet.addModule("recorder.js");
      const recorder = new AudioWorkletNode(context, "recorder");
      recorder.port.onmessage = ({ data }) => pieces.push(data);
      context.createMediaStreamSource(stream).connect(recorder);
    } catch {
      stream.getTracks().forEach((track) => track.stop());
      this.note("This browser cannot record at 16 kHz: type instead.");
      return;
    }
    const stop = (keeps) => {
      if (this.stopRecording !== stop) return;
      clearTimeout(limit);
      this.listening(null);
      stream.getTracks().forEach((track) => track.stop());
      context.close();
      if (!keeps) return;
      this.note("One moment: it is being heard.");
      this.send("hear", { pcm: encoded(pieces), rate: context.sampleRate });
    };
    const limit = setTimeout(() => stop(true), LONGEST - 200);
    this.listening(stop);
  }

  // ---- What was heard

  /** Show words in the box, and do what they ask for after a while, unless a person takes them back. */
  heard({ words, note }) {
    if (!words) {
      this.note(note);
      return;
    }
    this.note("");
    this.box.fill(words);
    this.box.input.focus();
    if (AT_ONCE.test(words)) {
      this.box.submit();
    } else if (this.acts?.checked ?? true) {
      this.box.input.classList.add("heard");
      this.timer = setTimeout(() => this.act(), DELAY);
    }
  }

  act() {
    const understood = !find("preview").classList.contains("refusal");
    this.keep();
    if (understood) this.box.submit();
    else this.note("That was not understood: change the words, or say it again.");
  }

  /** Leave the words in the box until somebody sends them. */
  keep() {
    clearTimeout(this.timer);
    this.timer = null;
    this.box.input.classList.remove("heard");
  }

  typed() {
    this.keep();
    this.note("");
  }

  /** Take back what was said. */
  cancel() {
    this.stopRecording?.(false);
    if (this.timer) this.box.fill("");
    this.keep();
    this.note("");
  }

  note(text) {
    setText(find("speech-note"), text);
  }

  /** Read an answer aloud, if that is chosen. */
  read(text) {
    if (!text || !this.aloud?.checked) return;
    const said = new SpeechSynthesisUtterance(text);
    said.lang = "en-US";
    window.speechSynthesis.speak(said);
  }
}

/** Pieces of sound in [-1, 1] as 16-bit samples in base64. */
function encoded(pieces) {
  const samples = pieces.flatMap((piece) => [...piece]);
  const view = new DataView(new ArrayBuffer(2 * samples.length));
  samples.forEach((sample, at) => view.setInt16(2 * at, 32767 * Math.min(Math.max(sample, -1), 1), true));
  let text = "";
  for (const byte of new Uint8Array(view.buffer)) text += String.fromCharCode(byte);
  return btoa(text);
}
