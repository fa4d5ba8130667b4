#!/usr/bin/perl
# Runs TAP tests, repeats the lines of those that failed, and ends with one line that
# counts them all. usage: run.pl [-j N] FILE...
use strict;
use warnings;
use File::Basename;
use TAP::Harness;

my $jobs = 1;
if (@ARGV > 1 && $ARGV[0] eq '-j') {
	(undef, $jobs) = splice @ARGV, 0, 2;
}
$ENV{CMOCKA_MESSAGE_OUTPUT} = 'TAP';
$| = 1;

my $harness = TAP::Harness->new({
	jobs => $jobs,
	timer => 1,
	exec => sub {
		my ($h, $file) = @_;
		return [$ENV{PYTHON} || '/usr/bin/python3', $file] if $file =~ /\.py$/;
		return ['sh', $file] if $file =~ /\.t$/;
		return [$file];
	},
});
my $cmocka = qr/error: Failure!$|^# not ok - /;    # says again what the test line says
my @lines;    # of failed tests, with the comments below them
$harness->callback(made_parser => sub {
	my ($parser, $job) = @_;
	my ($name, $failing) = (basename($job->[0]), 0);
	$parser->callback(ALL => sub {
		my ($line) = @_;
		$failing = !$line->is_ok if $line->is_test;
		return if !$failing || !($line->is_test || $line->is_comment);
		push @lines, "$name: " . $line->raw if $line->raw !~ $cmocka;
	});
});
my $all = $harness->runtests(@ARGV);
my $broken = grep { $_->has_problems && !$_->failed } map { $all->{parser_for}{$_} } @ARGV;
my $failed = scalar($all->failed) + $broken;
my ($passed, $skipped) = (scalar $all->passed, scalar $all->skipped);
print map { "$_\n" } @lines;
printf "%d passed, %d failed, %d skipped\n", $passed - $skipped, $failed, $skipped;
print "no test has '$ENV{ONLY}' in its name\n" if $all->total == 0 && $ENV{ONLY};
exit($failed || !$all->all_passed || $all->total == 0 ? 1 : 0);
