//! Who may depend on whom: the arrows of the manifests point down only.

/// Our packages in the manifest of a crate, in the order of its dependencies.
fn ours(manifest: &str) -> Vec<String> {
    let text = std::fs::read_to_string(manifest).unwrap_or_else(|why| panic!("{manifest}: {why}"));
    let (mut section, mut found) = (String::new(), Vec::new());
    for line in text.lines() {
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').into();
            continue;
        }
        let name = line.split(['.', ' ', '=']).next().unwrap_or_default();
        if section.ends_with("dependencies") && CRATES.iter().any(|(krate, _)| *krate == name) {
            found.push(name.to_string());
        }
    }
    found.sort();
    found
}

/// Our crates: the name in code, the folder.
const CRATES: [(&str, &str); 6] = [
    ("compiler", "compiler"),
    ("grammar", "grammar"),
    ("stdlib", "stdlib"),
    ("store", "stdlib/store"),
    ("vm", "vm"),
    ("world", "stdlib/world"),
];

#[test]
fn arrows_point_down() {
    assert_eq!(ours("grammar/Cargo.toml"), [""; 0]);
    assert_eq!(ours("vm/Cargo.toml"), [""; 0]);
    assert_eq!(ours("compiler/Cargo.toml"), ["grammar", "vm"]);
    assert_eq!(ours("stdlib/Cargo.toml"), ["vm"]);
    assert_eq!(ours("stdlib/store/Cargo.toml"), ["vm"]);
    assert_eq!(ours("stdlib/world/Cargo.toml"), ["vm"]);
}

/// The lines of a section of the root's manifest.
fn section(name: &str) -> Vec<String> {
    let text = std::fs::read_to_string("Cargo.toml").expect("the manifest is there");
    let (_, rest) = text.split_once(&format!("\n[{name}]\n")).unwrap_or_else(|| panic!("no section {name}"));
    let lines = rest.lines().take_while(|line| !line.starts_with('['));
    lines.map(str::to_string).collect()
}

#[test]
fn each_dependency_says_what_for() {
    let is_dependency = |line: &str| !line.starts_with('#') && line.contains('=');
    for name in ["workspace.dependencies", "dependencies"] {
        let mut commented = false;
        for line in section(name) {
            // Lines that follow one another share a comment; those of the workspace have theirs there.
            if line.starts_with('#') {
                commented = true;
            } else if is_dependency(&line) && !line.contains("workspace") {
                assert!(commented, "no comment says what this is for: {line}");
            } else if line.is_empty() {
                commented = false;
            }
        }
    }
}

#[test]
fn crates_take_their_dependencies_from_the_workspace() {
    for (name, folder) in CRATES {
        let text = std::fs::read_to_string(format!("{folder}/Cargo.toml")).expect("the manifest is there");
        let mut inside = false;
        for line in text.lines() {
            if line.starts_with('[') {
                inside = line.ends_with("dependencies]");
            } else if inside && line.contains('=') {
                assert!(line.contains("workspace = true"), "{name}: {line}");
            }
        }
    }
}
