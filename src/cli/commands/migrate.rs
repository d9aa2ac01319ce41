//! `hlacdb migrate`.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use hlacdb::volume::display_path;
use hlacdb::{Database, MigrateOptions};

use crate::cli::context::{Context, Failure, Outcome};

/// Upgrade a store of an older format
///
/// The old store is kept beside the new one as STORE.format-N.backup, unless --no-backup is given. A store of the current format
/// is left alone.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb migrate --check       only report what would be done
  hlacdb migrate")]
pub(crate) struct Migrate {
    /// Only report what would be done
    #[arg(long)]
    check: bool,

    /// Keep no copy of the old store
    #[arg(long)]
    no_backup: bool,
}

impl Migrate {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        if !context.store.exists() {
            return Err(hlacdb::Error::from(hlacdb::OpenError::NoStore { path: context.store.clone() }).into());
        }
        // The name of the backup contains the old version, which only the plan knows.
        let plan = Database::migrate(&context.store, &MigrateOptions::new().check_only(true))?;
        let report = if self.check || plan.hops.is_empty() {
            plan
        } else {
            let options = match self.no_backup {
                true => MigrateOptions::new(),
                false => MigrateOptions::new().backup(backup_name(context, plan.from)),
            };
            Database::migrate(&context.store, &options)?
        };
        let backup = report.backup.as_deref().map(display_path);
        if context.json {
            let (from, to, hops) = (report.from, report.to, &report.hops);
            context.print_json(&serde_json::json!({ "from": from, "to": to, "hops": hops, "backup": backup }))?;
            return Ok(Outcome::Done);
        }
        if report.hops.is_empty() {
            writeln!(context.out(), "format {}: current", report.from)?;
            return Ok(Outcome::Done);
        }
        let verb = if self.check { "would be migrated" } else { "migrated" };
        writeln!(context.out(), "{verb} from format {} to {}", report.from, report.to)?;
        for (version, hop) in (report.from..).zip(&report.hops) {
            writeln!(context.out(), "  {version} to {}: {hop}", version + 1)?;
        }
        if let Some(backup) = backup {
            writeln!(context.out(), "the old store: {backup}")?;
        }
        Ok(Outcome::Done)
    }
}

/// `STORE.format-N.backup`, beside the store.
fn backup_name(context: &Context, version: u32) -> PathBuf {
    let mut name = context.store.clone().into_os_string();
    name.push(format!(".format-{version}.backup"));
    name.into()
}
