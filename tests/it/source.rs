//! The source code of the workspace, parsed: its modules, the names each one defines and imports, and the paths it mentions.
//!
//! Items behind `#[cfg(test)]` and documentation are left out. A path is resolved through imports, globs and re-exports to
//! the module that defines the item. What a macro defines cannot be seen: such a path leads to the deepest module that is
//! known.

mod references;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

use syn::{Attribute, Item, UseTree, Visibility};

/// A module's place in [`Workspace::modules`].
pub(crate) type ModuleId = usize;

/// A path as written, one name per segment; an empty first name stands for a leading `::`.
pub(crate) type Names = Vec<String>;

/// One module: a file, or a block `mod name { ... }` inside a file.
#[derive(Default)]
pub(crate) struct Module {
    /// The file, from the root of the repository, with `/` between folders.
    pub(crate) file: String,
    /// The path of the module, beginning with the name of its crate.
    pub(crate) path: String,
    pub(crate) parent: Option<ModuleId>,
    /// The crate's root.
    pub(crate) root: ModuleId,
    /// Whether its declaration is `pub`.
    pub(crate) public: bool,
    /// The attributes of its declaration and of its file.
    pub(crate) attributes: Vec<Attribute>,
    /// What it contains, nested modules and imports included; without what only tests see.
    pub(crate) items: Vec<Item>,
    /// The modules it declares.
    pub(crate) children: Vec<ModuleId>,
    /// What it imports and re-exports.
    pub(crate) imports: Vec<Import>,
    /// Every path that its code mentions, imports aside.
    pub(crate) mentions: BTreeSet<Names>,
    names: BTreeMap<String, Vec<Definition>>,
    variants: BTreeMap<String, BTreeSet<String>>,
}

/// One leaf of a `use` declaration.
pub(crate) struct Import {
    pub(crate) path: Names,
    /// The name it has here; `None` for a glob.
    pub(crate) name: Option<String>,
    /// Whether it is visible outside the module, to any extent.
    pub(crate) exported: bool,
    /// Whether it is `pub`.
    pub(crate) public: bool,
    pub(crate) attributes: Vec<Attribute>,
}

#[derive(Clone)]
enum Definition {
    Module(ModuleId),
    Item,
    Import(Names),
}

/// What a path leads to.
#[derive(Clone, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(crate) enum Target {
    Item {
        module: ModuleId,
        name: String,
    },
    Module(ModuleId),
    /// Something of a crate outside the workspace; the path begins with the name of that crate.
    Foreign(Names),
}

/// All modules of some crates.
#[derive(Default)]
pub(crate) struct Workspace {
    pub(crate) modules: Vec<Module>,
    /// The roots of libraries by the names that code gives them.
    pub(crate) libraries: BTreeMap<String, ModuleId>,
}

/// Reads a file, named from the root of the repository.
type Read<'a> = &'a dyn Fn(&str) -> Option<String>;

impl Workspace {
    /// The root package and all members of the workspace in `folder`: their libraries and programs.
    pub(crate) fn of_repository(folder: &Path) -> Self {
        let read = |file: &str| std::fs::read_to_string(folder.join(file)).ok();
        let manifest = |member: &str| -> toml::Table {
            let file = format!("{member}Cargo.toml");
            read(&file).unwrap_or_else(|| panic!("no file {file}")).parse().unwrap()
        };
        let root = manifest("");
        let members = root["workspace"]["members"].as_array().unwrap();
        let members = members.iter().map(|member| format!("{}/", member.as_str().unwrap()));
        let mut workspace = Self::default();
        for member in std::iter::once(String::new()).chain(members) {
            let name = manifest(&member)["package"]["name"].as_str().unwrap().replace('-', "_");
            for (target, name) in [("lib", name.clone()), ("main", format!("{name} (program)"))] {
                let file = format!("{member}src/{target}.rs");
                if read(&file).is_some() {
                    workspace.add_crate(&name, &file, &read);
                }
            }
        }
        workspace
    }

    /// One crate by its root file.
    pub(crate) fn of_file(folder: &Path, name: &str, file: &str) -> Self {
        let mut workspace = Self::default();
        workspace.add_crate(name, file, &|file| std::fs::read_to_string(folder.join(file)).ok());
        workspace
    }

    /// Crates given as texts: `(name, root file)`, and the content of every file.
    pub(crate) fn of_texts(crates: &[(&str, &str)], files: &[(&str, &str)]) -> Self {
        let files: BTreeMap<&str, &str> = files.iter().copied().collect();
        let mut workspace = Self::default();
        for (name, file) in crates {
            workspace.add_crate(name, file, &|file| files.get(file).map(|&text| text.to_owned()));
        }
        workspace
    }

    fn add_crate(&mut self, name: &str, file: &str, read: Read) {
        let first = self.modules.len();
        let module = Module { file: file.to_owned(), path: name.to_owned(), root: first, ..Module::default() };
        let folder = folder_of(file).to_owned();
        self.add_file(module, &folder, read);
        self.libraries.insert(name.to_owned(), first);
        // Exported macros belong to the root of their crate, wherever they are defined.
        for id in first..self.modules.len() {
            for item in &self.modules[id].items {
                let Item::Macro(item) = item else { continue };
                let Some(name) = &item.ident else { continue };
                if id != first && item.attrs.iter().any(|attribute| attribute.path().is_ident("macro_export")) {
                    let name = name.to_string();
                    let mut path: Names = self.modules[id].path.split("::").map(str::to_owned).collect();
                    path[0] = "crate".to_owned();
                    path.push(name.clone());
                    self.modules[first].names.entry(name).or_default().push(Definition::Import(path));
                    break;
                }
            }
        }
    }

    /// Parses the file of `module`; the modules that it declares lie in `folder`.
    fn add_file(&mut self, mut module: Module, folder: &str, read: Read) -> ModuleId {
        let text = read(&module.file).unwrap_or_else(|| panic!("no file {}", module.file));
        let parsed = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", module.file));
        let items = if parsed.attrs.iter().any(only_for_tests) { Vec::new() } else { parsed.items };
        module.attributes.extend(parsed.attrs);
        self.add_module(module, items, folder, read)
    }

    fn add_module(&mut self, module: Module, items: Vec<Item>, folder: &str, read: Read) -> ModuleId {
        let id = self.modules.len();
        self.modules.push(module);
        let items: Vec<Item> = items.into_iter().filter(|item| !attributes(item).iter().any(only_for_tests)).collect();
        for item in &items {
            if let Item::Mod(declared) = item {
                let child = self.add_child(id, declared, folder, read);
                self.modules[id].children.push(child);
                self.define(id, &declared.ident.to_string(), Definition::Module(child));
            } else if let Some(name) = name_of(item) {
                self.define(id, &name, Definition::Item);
            }
            if let Item::Enum(item) = item {
                let variants = item.variants.iter().map(|variant| variant.ident.to_string()).collect();
                self.modules[id].variants.insert(item.ident.to_string(), variants);
            }
        }
        let found = references::find(&items);
        for import in &found.imports {
            if let Some(name) = &import.name {
                self.define(id, name, Definition::Import(import.path.clone()));
            }
        }
        let module = &mut self.modules[id];
        module.imports = found.imports;
        module.mentions = found.mentions;
        module.items = items;
        id
    }

    fn add_child(&mut self, parent: ModuleId, declared: &syn::ItemMod, folder: &str, read: Read) -> ModuleId {
        let name = declared.ident.to_string();
        let above = &self.modules[parent];
        let mut module = Module {
            file: above.file.clone(),
            path: format!("{}::{name}", above.path),
            parent: Some(parent),
            root: above.root,
            public: matches!(declared.vis, Visibility::Public(_)),
            attributes: declared.attrs.clone(),
            ..Module::default()
        };
        if let Some((_, items)) = &declared.content {
            return self.add_module(module, items.clone(), &join(folder, &name), read);
        }
        if let Some(path) = path_attribute(&declared.attrs) {
            module.file = join(folder_of(&above.file), &path);
            let folder = folder_of(&module.file).to_owned();
            return self.add_file(module, &folder, read);
        }
        let beside = join(folder, &format!("{name}.rs"));
        let inside = join(folder, &format!("{name}/mod.rs"));
        module.file = if read(&beside).is_some() { beside } else { inside };
        self.add_file(module, &join(folder, &name), read)
    }

    fn define(&mut self, module: ModuleId, name: &str, definition: Definition) {
        self.modules[module].names.entry(name.to_owned()).or_default().push(definition);
    }

    /// What a path that is written in a module leads to. A single name that the module does not know (a local variable, a
    /// parameter, something of the prelude) leads nowhere.
    pub(crate) fn resolve(&self, from: ModuleId, path: &[String]) -> Vec<Target> {
        self.resolve_guarded(from, path, &RefCell::default())
    }

    fn resolve_guarded(&self, from: ModuleId, path: &[String], visiting: &Visiting) -> Vec<Target> {
        let [first, rest @ ..] = path else { return vec![Target::Module(from)] };
        let start = match first.as_str() {
            "crate" => vec![Target::Module(self.modules[from].root)],
            "self" => vec![Target::Module(from)],
            "super" => vec![Target::Module(self.modules[from].parent.unwrap_or(from))],
            "" => {
                return rest
                    .first()
                    .map_or(Vec::new(), |name| self.walk(vec![self.external(name)], &rest[1..], visiting));
            }
            name => {
                let known = self.lookup(from, name, visiting);
                // `Self` and parameters such as `T` in `T::Item` begin with a capital, crates never do.
                let is_crate =
                    name.starts_with(char::is_lowercase) && !rest.is_empty() || self.libraries.contains_key(name);
                if known.is_empty() && is_crate { vec![self.external(name)] } else { known }
            }
        };
        if start.is_empty() { start } else { self.walk(start, rest, visiting) }
    }

    fn external(&self, name: &str) -> Target {
        match self.libraries.get(name) {
            Some(&root) => Target::Module(root),
            None => Target::Foreign(vec![name.to_owned()]),
        }
    }

    fn walk(&self, start: Vec<Target>, rest: &[String], visiting: &Visiting) -> Vec<Target> {
        let is_module = |target: &Target| matches!(target, Target::Module(_));
        let mut current = start;
        for name in rest {
            // Where a name means a module and something else, a path goes on through the module.
            if current.iter().any(is_module) {
                current.retain(is_module);
            }
            let step = |target: Target| match target {
                Target::Module(id) if name == "super" => vec![Target::Module(self.modules[id].parent.unwrap_or(id))],
                Target::Module(id) => match self.lookup(id, name, visiting) {
                    found if found.is_empty() => vec![Target::Item { module: id, name: name.clone() }],
                    found => found,
                },
                Target::Item { .. } => vec![target],
                Target::Foreign(mut path) => {
                    path.push(name.clone());
                    vec![Target::Foreign(path)]
                }
            };
            current = current.into_iter().flat_map(step).collect();
        }
        if current.iter().any(|target| !is_module(target)) {
            current.retain(|target| !is_module(target));
        }
        current.sort();
        current.dedup();
        current
    }

    fn lookup(&self, module: ModuleId, name: &str, visiting: &Visiting) -> Vec<Target> {
        let key = (module, name.to_owned());
        if !visiting.borrow_mut().insert(key.clone()) {
            return Vec::new();
        }
        let own = self.modules[module].names.get(name).into_iter().flatten();
        let mut found: Vec<Target> = own
            .flat_map(|definition| match definition {
                Definition::Module(id) => vec![Target::Module(*id)],
                Definition::Item => vec![Target::Item { module, name: name.to_owned() }],
                Definition::Import(path) => self.resolve_guarded(module, path, visiting),
            })
            .collect();
        if found.is_empty() {
            let globs = self.modules[module].imports.iter().filter(|import| import.name.is_none());
            for target in globs.flat_map(|glob| self.resolve_guarded(module, &glob.path, visiting)) {
                match target {
                    Target::Module(id) => found.extend(self.lookup(id, name, visiting)),
                    Target::Item { module, name: of } => {
                        let variants = self.modules[module].variants.get(&of);
                        if variants.is_some_and(|variants| variants.contains(name)) {
                            found.push(Target::Item { module, name: of });
                        }
                    }
                    Target::Foreign(_) => {}
                }
            }
        }
        visiting.borrow_mut().remove(&key);
        found
    }
}

/// The names that are being looked up, so that imports in a circle end.
type Visiting = RefCell<HashSet<(ModuleId, String)>>;

fn folder_of(file: &str) -> &str {
    file.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// A path inside a folder, with `..` taken out.
fn join(folder: &str, path: &str) -> String {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split('/') {
        if part == ".." {
            parts.pop();
        } else {
            parts.push(part);
        }
    }
    parts.join("/")
}

fn path_attribute(attributes: &[Attribute]) -> Option<String> {
    attributes.iter().filter(|attribute| attribute.path().is_ident("path")).find_map(|attribute| {
        let syn::Expr::Lit(literal) = &attribute.meta.require_name_value().ok()?.value else { return None };
        let syn::Lit::Str(path) = &literal.lit else { return None };
        Some(path.value())
    })
}

/// The attributes of an item; none for what syn does not take apart.
pub(crate) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::ForeignMod(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::TraitAlias(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

/// The name that an item defines; modules, imports and implementations define none of this kind.
pub(crate) fn name_of(item: &Item) -> Option<String> {
    let ident = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::TraitAlias(item) => &item.ident,
        Item::Type(item) => &item.ident,
        Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(ident.to_string())
}

/// Whether an attribute leaves an item out of everything but tests: `#[cfg(test)]`, also as a part of `all(...)`.
pub(crate) fn only_for_tests(attribute: &Attribute) -> bool {
    fn needs_test(meta: &syn::Meta) -> bool {
        let parts = |list: &syn::MetaList| -> Vec<syn::Meta> {
            let parser = syn::punctuated::Punctuated::<syn::Meta, syn::Token![,]>::parse_terminated;
            list.parse_args_with(parser).map(|parts| parts.into_iter().collect()).unwrap_or_default()
        };
        match meta {
            syn::Meta::Path(path) => path.is_ident("test") || path.is_ident("doctest"),
            syn::Meta::List(list) if list.path.is_ident("all") => parts(list).iter().any(needs_test),
            syn::Meta::List(list) if list.path.is_ident("any") => {
                let parts = parts(list);
                !parts.is_empty() && parts.iter().all(needs_test)
            }
            _ => false,
        }
    }
    attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Meta>().is_ok_and(|meta| needs_test(&meta))
}

/// The leaves of a tree of imports.
fn leaves(tree: &UseTree, prefix: &[String], found: &mut Vec<(Names, Option<String>)>) {
    let with = |name: &dyn ToString| -> Names { prefix.iter().cloned().chain([name.to_string()]).collect() };
    match tree {
        UseTree::Path(path) => leaves(&path.tree, &with(&path.ident), found),
        UseTree::Name(name) if name.ident == "self" => {
            found.push((prefix.to_vec(), prefix.last().cloned()));
        }
        UseTree::Name(name) => found.push((with(&name.ident), Some(name.ident.to_string()))),
        UseTree::Rename(rename) => {
            let path = if rename.ident == "self" { prefix.to_vec() } else { with(&rename.ident) };
            found.push((path, Some(rename.rename.to_string())));
        }
        UseTree::Glob(_) => found.push((prefix.to_vec(), None)),
        UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, prefix, found)),
    }
}
