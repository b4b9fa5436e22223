// Starts `mopro lsp` and hands it the texts of the language `mopro`; all else is the server's.

const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = async () => {
  const [command, ...args] = workspace.getConfiguration("mopro").get("command");
  client = new LanguageClient(
    "mopro",
    "MoPro",
    { command, args },
    { documentSelector: [{ language: "mopro" }] },
  );
  await client.start();
};

exports.deactivate = () => client?.stop();
